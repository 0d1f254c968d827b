"""Collections of strings are checked before the library reads them, which may never end in a damaged one."""

import struct

import h5py
import numpy as np
import pytest

from crowdsim.errors import RecordingError
from crowdsim.recording.reader import Recording
from crowdsim.recording.storage.string_heaps import require_sound_heaps
from tests.support.older_recording import make_older
from tests.support.small_recording import write_small_recording


@pytest.fixture
def path(tmp_path):
    """Return a recording from before checksums, for which these checks are."""
    return make_older(write_small_recording(tmp_path / "run.h5"))


def collections(content):
    places, at = [], content.find(b"GCOL")
    while at >= 0:
        places.append(at)
        at = content.find(b"GCOL", at + 1)
    return places


def objects(content, place):
    """(byte, number, size) of each object of the collection."""
    end, at = place + struct.unpack_from("<Q", content, place + 8)[0], place + 16
    while at + 16 <= end:
        number, size = struct.unpack_from("<H6xQ", content, at)
        yield at, number, size
        at += size if number == 0 else 16 + (size + 7) // 8 * 8


def test_what_the_library_writes_is_sound(path, tmp_path):
    require_sound_heaps(path)
    with h5py.File(tmp_path / "strings.h5", "w") as file:
        for number in range(40):
            texts = [str(other) * (number * other % 700) for other in range(60)]
            file.create_dataset(f"{number}", data=np.array(texts, object), dtype=h5py.string_dtype())
            if number % 3 == 2:
                del file[f"{number - 1}"]
    require_sound_heaps(tmp_path / "strings.h5")


def test_every_object_that_claims_another_size_is_seen(path):
    """The library never ended where the free rest claimed none; with no more than a byte for a text, too."""
    content = path.read_bytes()
    places = collections(content)
    assert places
    for place in places:
        found = list(objects(content, place))
        rest = [at for at, number, _ in found if number == 0]
        for at, _, _ in found[:2] + found[-1:]:
            damaged = bytearray(content)
            damaged[at + 8 : at + 16] = struct.pack("<Q", 1 << 40)
            path.write_bytes(bytes(damaged))
            with pytest.raises(RecordingError, match="does not end"):
                Recording.open(path)
        for at in rest:
            damaged = bytearray(content)
            damaged[at + 8 : at + 16] = bytes(8)
            path.write_bytes(bytes(damaged))
            with pytest.raises(RecordingError, match="does not end"):
                Recording.open(path)


@pytest.mark.parametrize("size", [0, 4095, 1 << 62])
def test_a_collection_of_impossible_size_is_damage(path, size):
    content = bytearray(path.read_bytes())
    place = collections(bytes(content))[0]
    content[place + 8 : place + 16] = struct.pack("<Q", size)
    path.write_bytes(bytes(content))
    with pytest.raises(RecordingError, match=f"claims {size} bytes"):
        Recording.open(path)


def test_a_collection_across_two_parts_of_the_search_is_found(tmp_path):
    path = tmp_path / "long"
    path.write_bytes(bytes((1 << 22) - 5) + b"GCOL\1\0\0\0" + bytes(5000))
    with pytest.raises(ValueError, match="claims 0 bytes"):
        require_sound_heaps(path)


@pytest.mark.parametrize("values", [np.full((1, 3), b"x", "S5"), np.nan])
@pytest.mark.parametrize("name", ["offsets", "end_offsets"])
def test_skeletons_whose_joints_are_nowhere_are_damage(path, name, values):
    with h5py.File(path, "r+") as file:
        skeleton = next(group for group in (file["motion"], file["motion"].get("skeleton")) if group and name in group)
        shape = skeleton[name].shape
        if shape[0] == 0:
            pytest.skip("this skeleton has no ends")
        del skeleton[name]
        skeleton[name] = np.broadcast_to(values, shape).copy()
    with pytest.raises(RecordingError, match=f"{name} holds"):
        Recording.open(path)
