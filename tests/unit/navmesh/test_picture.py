"""A mesh as a picture."""

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
import shapely
from matplotlib.figure import Figure

from crowdsim.errors import CrowdSimError, GeometryError
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.picture import _Shapes

ROOM = shapely.box(0, 0, 10, 7).difference(shapely.union_all([shapely.box(4, 0, 5, 4), shapely.box(7, 2, 8, 5)]))


@pytest.fixture(scope="module")
def mesh():
    return NavMesh(ROOM).with_points([(2.0, 5.0), (3.0, 2.0)])


def _pixels(figure: Figure) -> np.ndarray:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].astype(int)


def _labels(figure: Figure) -> set[str]:
    return {text.get_text() for text in figure.legends[0].get_texts()}


def test_a_picture_grows_with_what_is_asked(mesh):
    path = mesh.find_path((1, 1), (6, 1), 0.3)
    plain, with_radius, with_path = mesh.picture(), mesh.picture(radius=0.3), mesh.picture(path)
    assert _labels(plain) < _labels(with_radius) < _labels(with_path)
    assert "where a radius of 0.3 m is free" in _labels(with_path)
    pictures = [_pixels(figure) for figure in (plain, with_radius, with_path)]
    assert all(picture.shape == (700, 1000, 3) for picture in pictures)
    assert all((one != other).any() for one, other in pairwise(pictures))
    np.testing.assert_array_equal(_pixels(mesh.picture(path.points, 0.3)), pictures[2])


@pytest.mark.parametrize(("name", "start"), [("a.png", b"\x89PNG"), ("b.svg", b"<?xml"), ("c.PDF", b"%PDF")])
def test_files_are_complete_and_alone(mesh, tmp_path, name, start):
    mesh.picture([(1, 1), (2, 2)], 0.2, tmp_path / name)
    assert [file.name for file in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_bytes().startswith(start)


def test_a_failure_leaves_the_old_file(mesh, tmp_path, monkeypatch):
    def fail(self, file):
        with open(file, "wb") as half:
            half.write(b"half")
        raise OSError("disk full")

    old = tmp_path / "a.png"
    old.write_bytes(b"old")
    monkeypatch.setattr(Figure, "savefig", fail)
    with pytest.raises(OSError, match="disk full"):
        mesh.picture(file=old)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"old"]


def test_wrong_arguments_are_refused(mesh, tmp_path):
    with pytest.raises(CrowdSimError, match=r"\.png, \.svg or \.pdf"):
        mesh.picture(file=tmp_path / "a.gif")
    with pytest.raises(CrowdSimError, match="does not exist"):
        mesh.picture(file=tmp_path / "absent" / "a.png")
    with pytest.raises(GeometryError, match="two points"):
        mesh.picture([(1, 1)])
    with pytest.raises(GeometryError, match="radius"):
        mesh.picture(radius=-1.0)


def test_crossings_of_obstacles_are_not_said_to_come_from_refinement():
    crossed = NavMesh(ROOM)
    crossed.insert_obstacle(shapely.box(3.5, 3.0, 5.5, 3.5))
    assert [4.0, 3.0] in _Shapes(crossed.arrays).added.tolist()
    assert "vertex that is no corner" in _labels(crossed.picture())


def test_a_radius_that_fits_nowhere_is_drawn_as_nothing(mesh):
    assert "where a radius of 9 m is free" not in _labels(mesh.picture(radius=9.0))


def test_shapes_are_those_of_the_area(mesh):
    shapes = _Shapes(mesh.arrays)
    assert shapely.union_all(shapely.polygons(shapes.free)).area == pytest.approx(ROOM.area, abs=1e-4)
    walls = shapely.union_all(shapely.multilinestrings(list(shapes.walls)))
    assert walls.length == pytest.approx(ROOM.boundary.length, abs=1e-4)
    around = ROOM.boundary.union(shapely.MultiPoint([(2.0, 5.0), (3.0, 2.0)]))
    assert shapes.fits(0.4).area == pytest.approx(ROOM.difference(around.buffer(0.4, quad_segs=24)).area, abs=1e-2)
    sectors, widths = shapes.sectors()
    assert len(sectors) == len(widths) == np.count_nonzero(shapes.widths)
    outlines = shapely.polygons(sectors)
    assert shapely.is_valid(outlines).all()
    triangles = np.repeat(shapely.polygons(shapes.free), 3)[shapes.widths.ravel() > 0.0]
    assert shapely.area(shapely.difference(outlines, triangles)).max() < 1e-9


def test_drawing_needs_no_display_and_no_global_state():
    code = (
        "import sys, shapely\n"
        "from crowdsim.navmesh.navmesh import NavMesh\n"
        "assert 'matplotlib' not in sys.modules\n"
        "NavMesh(shapely.box(0, 0, 4, 4)).picture()\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
