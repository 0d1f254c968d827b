"""Motion maps kept in a file."""

import contextlib
from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import CacheWarning, CrowdSimError, MotionError
from crowdsim.following.maps import map_file
from crowdsim.following.maps.map_file import load_maps, maps_in_file, maps_key, save_maps
from crowdsim.following.maps.motion_maps import MotionMaps
from tests.unit.following.walking_graph import graph_of, pieces

GRAPH = graph_of(pieces())
SMALL = {"depth": 2, "reach": 2.2, "max_entries": 400}


def equal(a: MotionMaps, b: MotionMaps) -> bool:
    return all(
        x.dtype == y.dtype and x.shape == y.shape and np.array_equal(x, y)
        for x, y in zip(a.arrays, b.arrays, strict=True)
    )


def test_maps_come_back_as_they_were_built(tmp_path: Path) -> None:
    built = maps_in_file(tmp_path / "new", GRAPH, **SMALL)
    assert len(list((tmp_path / "new").iterdir())) == 1
    loaded = maps_in_file(tmp_path / "new", GRAPH, **SMALL)
    assert equal(built, loaded)
    assert equal(MotionMaps.build(GRAPH, **SMALL), loaded)


def test_what_is_kept_is_not_built_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    maps_in_file(tmp_path, GRAPH, **SMALL)
    monkeypatch.setattr(MotionMaps, "build", None)
    assert maps_in_file(tmp_path, GRAPH, **SMALL).entry_count > 0


def test_every_number_and_array_is_part_of_the_name() -> None:
    keys = {maps_key(GRAPH, **SMALL)}
    keys |= {maps_key(GRAPH, **(SMALL | {name: value + 1})) for name, value in SMALL.items()}
    for name, column in zip(GRAPH._fields, GRAPH, strict=True):
        changed = column.copy()
        changed.flat[0] = not changed.flat[0] if changed.dtype == bool else changed.flat[0] + 1
        keys.add(maps_key(GRAPH._replace(**{name: changed}), **SMALL))
    assert len(keys) == 1 + len(SMALL) + len(GRAPH)


@pytest.mark.parametrize("damage", ["cut", "other", "empty", "head", "byte", "version"])
def test_a_file_that_cannot_be_read_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damage: str) -> None:
    built = maps_in_file(tmp_path, GRAPH, **SMALL)
    (file,) = tmp_path.iterdir()
    content = file.read_bytes()
    if damage == "version":
        monkeypatch.setattr(map_file, "VERSION", map_file.VERSION + 1)
    else:
        damaged = {
            "cut": content[:-100],
            "other": b"something else",
            "empty": b"",
            "head": content.replace(b'"<f8", [', b'"<f8", [9999999', 1),
            "byte": content[:-70] + bytes([content[-70] ^ 1]) + content[-69:],
        }
        file.unlink()  # it is mapped into memory
        file.write_bytes(damaged[damage])
    with pytest.raises(MotionError, match="cannot be read as motion maps"):
        load_maps(file)
    with contextlib.nullcontext() if damage == "version" else pytest.warns(CacheWarning, match="rebuilt"):
        assert equal(maps_in_file(tmp_path, GRAPH, **SMALL), built)
    assert equal(maps_in_file(tmp_path, GRAPH, **SMALL), built)


def test_a_write_that_fails_leaves_nothing(tmp_path: Path) -> None:
    maps = MotionMaps.build(GRAPH, **SMALL)
    broken = MotionMaps(maps.arrays._replace(outline=None))
    with pytest.raises(AttributeError):
        save_maps(broken, tmp_path / "broken.maps")
    with pytest.raises(CrowdSimError, match=r"\.maps"):
        save_maps(maps, tmp_path / "maps.txt")
    assert not list(tmp_path.iterdir())


def test_maps_that_cannot_be_stored_are_used_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(maps: MotionMaps, file: Path) -> None:
        raise CrowdSimError(f"cannot write {file} (No space left on device); make room on its disk")

    monkeypatch.setattr(map_file, "save_maps", full)
    with pytest.warns(CacheWarning, match="built again in the next run.*make room"):
        maps = maps_in_file(tmp_path, GRAPH, **SMALL)
    assert equal(maps, MotionMaps.build(GRAPH, **SMALL))
