"""What a page holds, read back without a browser."""

import gzip
import json
from dataclasses import replace

import numpy as np
import pytest

from crowdsim.errors import CrowdSimError
from crowdsim.export.page.far_body import MOST_VERTICES, build_far_body
from crowdsim.export.page.packing import MAGIC, Block, text_of, varints, zigzag
from crowdsim.export.page.page import PageOptions, write_page
from crowdsim.export.page.tracks.track_chunks import PHASES
from crowdsim.motion.deformed.phase_kernels import STAND
from crowdsim.recording.reader import Recording
from tests.support.odd_recording import odd_header, write_recording
from tests.support.page_data import PageData, bytes_of, read_page, unzigzag
from tests.support.small_recording import small_skeleton, write_small_recording


def test_the_phase_of_a_body_at_rest_is_a_whole_number_of_units():
    """Else its page plans other steps: it takes a phase as that of a stand within 5e-5 cycles."""
    resting = STAND + 0.5 * np.arange(400)
    np.testing.assert_allclose(np.rint(resting * PHASES) / PHASES, resting, rtol=0.0, atol=1e-9)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    path = write_small_recording(tmp_path_factory.mktemp("page") / "small.h5")
    with Recording.open(path) as recording:
        yield recording


def page_of(recording, folder, **options) -> PageData:
    file = folder / "page.html"
    write_page(recording, file, PageOptions(**options))
    return read_page(file)


def test_varints_hold_numbers_of_any_size():
    values = np.array([0, 1, 127, 128, 300, 16383, 16384, 2**31, 2**40])
    packed = varints(values)
    assert packed[:3].tolist() == [0, 1, 127]
    assert PageData.numbers(packed).tolist() == values.tolist()
    assert varints(np.zeros(0, np.int64)).size == 0


def test_zigzag_gives_small_numbers_for_small_ones_of_either_sign():
    values = np.array([0, -1, 1, -2, 2, 2**35, -(2**35)])
    assert zigzag(values)[:5].tolist() == [0, 1, 2, 3, 4]
    assert unzigzag(zigzag(values)).tolist() == values.tolist()


@pytest.mark.parametrize("count", [0, 1, 5, 6, 47, 48, 100_000])
def test_text_holds_bytes_in_letters_that_mean_nothing_to_html(count):
    data = np.random.default_rng(count).integers(0, 256, count, np.uint8).tobytes()
    text = text_of(data)
    assert bytes_of(text) == data
    assert len(text.encode("utf-16-le")) <= 1.0213 * count + 24
    letters = set(text.split(" ")[1])
    assert all(0x0C00 <= ord(letter) < 0xD800 for letter in letters)
    if count >= 100_000:
        assert len(letters) > 30_000


def test_a_block_names_its_arrays_and_is_the_same_twice():
    def packed() -> bytes:
        block = Block()
        block.add("bytes", np.arange(3, dtype=np.uint8))
        block.add("numbers", np.array([1.5, -2.0], np.float32))
        return block.packed({"title": "x"})

    whole = gzip.decompress(packed())
    assert whole[:4] == MAGIC
    length = int.from_bytes(whole[4:8], "little")
    facts = json.loads(whole[8 : 8 + length])
    assert facts["arrays"]["numbers"] == [4, "float32", 2]
    assert packed() == packed()


def test_tracks_come_back_to_half_a_millimeter(small, tmp_path):
    page = page_of(small, tmp_path)
    x, y, heading, here = page.tracks()
    assert here.tolist() == (small.state[:] > 0).tolist()
    assert np.abs(x - small.x[:])[here].max() <= 0.00051
    assert np.abs(y - small.y[:])[here].max() <= 0.00051
    turned = np.abs(np.angle(np.exp(1j * (heading - small.heading[:]))))
    assert turned[here].max() <= np.pi / 8192 + 1e-6


def test_a_page_of_some_seconds_and_characters_holds_no_others(small, tmp_path):
    page = page_of(small, tmp_path, start=1.0, end=2.0, agents="0,2")
    assert page.facts["agents"] == [0, 2]
    assert (page.facts["first"], page.facts["steps"]) == (20, 21)
    x, _, _, here = page.tracks()
    assert np.abs(x - small.x[20:41][:, [0, 2]])[here].max() <= 0.00051


def test_paths_are_left_out_if_none_are_asked_for(small, tmp_path):
    assert page_of(small, tmp_path).facts["path_count"] == 3
    page = page_of(small, tmp_path, paths="none")
    assert page.facts["path_count"] == 0
    assert "path_points" not in page.facts["arrays"]


def test_names_stay_text_and_the_page_asks_nobody(small, tmp_path):
    name = "</script><script>alert(1)</script> \"two\" 'one' & \u05e9\u05dc\u05d5\u05dd"
    file = tmp_path / "page.html"
    write_page(small, file, PageOptions(title=name))
    text = file.read_text(encoding="utf-16")
    assert "alert(1)" not in text.replace("&lt;script&gt;alert(1)", "")
    assert text.count("</script>") == 3
    assert "default-src 'none'" in text
    assert "https://" not in text.split("<script>")[0]
    assert read_page(file).facts["title"] == name


def test_the_same_recording_gives_the_same_bytes(small, tmp_path):
    for name in ("a.html", "b.html"):
        write_page(small, tmp_path / name)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"start": 3.0, "end": 2.0}, "exchange"),
        ({"end": 99.0}, "outside"),
        ({"agents": "7"}, "neither a group nor an agent '7'"),
        ({"paths": "some"}, "choose one of them"),
    ],
)
def test_what_cannot_be_shown_is_refused(small, tmp_path, options, words):
    with pytest.raises(CrowdSimError, match=words):
        page_of(small, tmp_path, **options)
    assert not list(tmp_path.iterdir())


def test_recordings_without_steps_or_people_say_so_or_are_shown(tmp_path):
    header = odd_header()
    with (
        Recording.open(write_recording(tmp_path / "none.h5", header, 0)) as recording,
        pytest.raises(CrowdSimError, match="nothing to show"),
    ):
        write_page(recording, tmp_path / "none.html")
    with Recording.open(write_recording(tmp_path / "empty.h5", replace(header, solids=()), 3, False)) as recording:
        write_page(recording, tmp_path / "empty.html")
    assert read_page(tmp_path / "empty.html").facts["most"] == 0


def test_the_body_of_the_far_side_has_few_vertices_and_stands_as_tall_as_the_near_one():
    body = build_far_body(small_skeleton())
    assert body.vertex_count <= MOST_VERTICES
    assert (body.weights == [1.0, 0.0]).all()
    points = body.places[:, 0] + small_skeleton().rest_positions()[body.joints[:, 0]]
    edges = np.sort(body.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()  # closed
    assert 1.5 < np.ptp(points[:, 2]) < 1.9


def test_a_title_may_look_like_a_part_of_the_page(small, tmp_path):
    page = page_of(small, tmp_path, title="{{style}} {{data}} {{title}}")
    assert page.facts["title"] == "{{style}} {{data}} {{title}}"
    assert "<title>{{style}} {{data}} {{title}}</title>" in (tmp_path / "page.html").read_text("utf-16")
