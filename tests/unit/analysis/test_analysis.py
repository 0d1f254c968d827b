"""Analyses: their numbers are PedPy's on exported tracks, and odd recordings end in words."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pandas
import pedpy
import pytest
from matplotlib.figure import Figure
from shapely import MultiPolygon, box

from crowdsim.analysis.analyze import MEASUREMENTS, analyze
from crowdsim.analysis.company import nearest_distances
from crowdsim.analysis.densities import level_shares
from crowdsim.analysis.leaving import characters
from crowdsim.analysis.measured_people import FLOW_BANDS, QUEUES, WALKWAYS, flow_band, weidmann_speed
from crowdsim.analysis.report import write_analysis
from crowdsim.errors import CrowdSimError
from crowdsim.export.formats import export
from crowdsim.recording.header import Ends, ShapeRecord
from tests.support.walking_recording import HALL, RATE, hall_header, random_walkers, write_tracks

MIDDLE = box(-1.0, -1.5, 1.5, 1.5)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Forty people who walk across the hall within half a minute."""
    with write_tracks(tmp_path_factory.mktemp("analysis") / "run.h5", *random_walkers(40, 300)) as opened:
        yield opened


@pytest.fixture(scope="module")
def analysis(recording):
    return analyze(recording)


@pytest.fixture(scope="module")
def exported(recording, tmp_path_factory):
    """What PedPy reads of the same recording: trajectories and the walkable area."""
    file = export(recording, tmp_path_factory.mktemp("exported") / "run.sqlite")
    trajectory = pedpy.load_trajectory_from_jupedsim_sqlite(trajectory_file=file)
    return trajectory, pedpy.load_walkable_area_from_jupedsim_sqlite(trajectory_file=file)


def result_of(analysis, name):
    return next(result for result in analysis.results if result.name == name)


def speeds_of(trajectory):
    border = pedpy.SpeedCalculation.BORDER_SINGLE_SIDED
    return pedpy.compute_individual_speed(traj_data=trajectory, frame_step=RATE // 2, speed_calculation=border)


def test_passages_are_those_that_pedpy_finds_in_the_exported_file(analysis, exported):
    trajectory, _ = exported
    line = pedpy.MeasurementLine([(0.0, -2.5), (0.0, 2.5)])
    nt, crossings = pedpy.compute_n_t(traj_data=trajectory, measurement_line=line)
    found = result_of(analysis, "flow")
    assert found.values["across"]["passages"] == nt["cumulative_pedestrians"].iloc[-1] == 40
    expected = crossings.sort_values(["frame", "id"])
    table = found.table.sort_values(["time", "agent"])
    np.testing.assert_array_equal(table["agent"], expected["id"])
    np.testing.assert_allclose(table["time"], expected["frame"] / RATE)
    times = np.sort(expected["frame"].to_numpy() / RATE)
    assert found.values["across"]["flow"] == pytest.approx(31 / (times[-5] - times[4]))
    assert found.values["across"]["flow_per_m"] == pytest.approx(31 / (times[-5] - times[4]) / 5.0)


def test_lines_and_areas_count_within_their_times(analysis, tmp_path):
    header = hall_header(40)
    (area,), (line,) = header.areas, header.lines
    later = replace(line, name="later", start=8.0, end=14.0)
    header = replace(header, areas=(replace(area, start=8.0, end=14.0),), lines=(line, later))
    with write_tracks(tmp_path / "run.h5", *random_walkers(40, 300), header=header) as recording:
        assert (recording.header.lines[1].start, recording.header.lines[1].end) == (8.0, 14.0)
        found = analyze(recording, only=("flow", "diagram"))
    whole, times = result_of(analysis, "flow").table["time"], result_of(found, "flow").table
    assert (times[times.line == "across"]["time"].to_numpy() == whole.to_numpy()).all()
    expected = whole[(whole >= 8.0) & (whole < 14.0)]
    assert 0 < len(expected) < 40
    assert times[times.line == "later"]["time"].tolist() == expected.tolist()
    whole = result_of(analysis, "diagram").table
    expected = whole[(whole.time >= 8.0) & (whole.time < 14.0)]
    assert 0 < len(expected) < len(whole)
    pandas.testing.assert_frame_equal(
        result_of(found, "diagram").table.reset_index(drop=True), expected.reset_index(drop=True)
    )
    assert any("from 8 to 14 s" in text for text in result_of(found, "diagram").sentences)


@pytest.mark.parametrize(("lines", "drawn"), [((), True), (["whole hall=-4,0,4,0"], False)])
def test_flows_of_people_are_drawn_if_all_lines_are_as_wide(recording, lines, drawn):
    result = result_of(analyze(recording, lines=lines, only=["flow"]), "flow")
    figure = Figure()
    result.draw(figure)
    notes = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert any("bottlenecks" in note for note in notes) == drawn


def test_passages_in_the_text_file_are_the_same(recording, analysis, tmp_path):
    file = export(recording, tmp_path / "run.txt")
    trajectory = pedpy.load_trajectory_from_txt(trajectory_file=file)
    line = pedpy.MeasurementLine([(0.0, -2.5), (0.0, 2.5)])
    _, crossings = pedpy.compute_n_t(traj_data=trajectory, measurement_line=line)
    np.testing.assert_allclose(
        np.sort(result_of(analysis, "flow").table["time"]), np.sort(crossings["frame"].to_numpy() / RATE)
    )


def test_densities_and_speeds_are_those_that_pedpy_finds_in_the_exported_file(analysis, exported):
    trajectory, walkable = exported
    area, speeds = pedpy.MeasurementArea(MIDDLE), speeds_of(trajectory)
    cells = pedpy.compute_individual_voronoi_polygons(traj_data=trajectory, walkable_area=walkable)
    voronoi, shares = pedpy.compute_voronoi_density(individual_voronoi_data=cells, measurement_area=area)
    expected = {
        "density_classic": pedpy.compute_classic_density(traj_data=trajectory, measurement_area=area)["density"],
        "density_voronoi": voronoi["density"],
        "speed_classic": pedpy.compute_mean_speed_per_frame(
            traj_data=trajectory, individual_speed=speeds, measurement_area=area
        )["speed"],
        "speed_voronoi": pedpy.compute_voronoi_speed(
            traj_data=trajectory,
            individual_speed=speeds,
            individual_voronoi_intersection=shares[shares["intersection"].notna()],
            measurement_area=area,
        )["speed"],
    }
    table = result_of(analysis, "diagram").table
    assert len(table) > 20
    assert (table["density_classic"] > 0.6).any()
    first = int(trajectory.data["frame"].min())
    rows = (table["time"] * RATE).round().astype(int) - first
    for column, values in expected.items():
        np.testing.assert_allclose(table[column], values.to_numpy()[rows], rtol=1e-6, err_msg=column)
    dense = table["density_classic"] >= 0.6
    np.testing.assert_array_equal(table["density"], np.where(dense, table["density_voronoi"], table["density_classic"]))


def test_distances_are_those_of_brute_force_and_of_pedpys_neighbors(analysis, exported):
    trajectory, walkable = exported
    cells = pedpy.compute_individual_voronoi_polygons(traj_data=trajectory, walkable_area=walkable)
    pairs = pedpy.compute_neighbors(individual_voronoi_data=cells, as_list=False)
    of_pairs = pedpy.compute_neighbor_distance(traj_data=trajectory, neighborhood=pairs)
    expected = of_pairs.groupby(["id", "frame"])["distance"].min()
    table = analysis.tracks.table
    found = nearest_distances(table["frame"].to_numpy(), table[["x", "y"]].to_numpy())
    mine = pandas.Series(found, index=pandas.MultiIndex.from_frame(table[["id", "frame"]]))
    np.testing.assert_allclose(mine.loc[expected.index], expected, rtol=1e-9)
    for frame in (50, 120):
        here = table[table["frame"] == frame][["x", "y"]].to_numpy()
        apart = np.linalg.norm(here[:, None] - here[None], axis=2) + np.diag(np.full(len(here), np.inf))
        np.testing.assert_allclose(found[table["frame"] == frame], apart.min(axis=1))
    values = result_of(analysis, "distances").values
    assert values["least"] == pytest.approx(found.min())
    assert sum(values["zones"].values()) == pytest.approx(1.0)


def test_the_time_map_is_pedpys(analysis, exported):
    trajectory, _ = exported
    floor = pedpy.AxisAlignedMeasurementArea(*HALL.bounds)
    last = pedpy.compute_rset_map(traj_data=trajectory, axis_aligned_measurement_area=floor, grid_size=0.5)
    result = result_of(analysis, "maps")
    assert result.values["last"] == np.nanmax(last)
    for row in result.table.dropna(subset="last").itertuples():
        down, right = int((2.5 - row.y) / 0.5), int((row.x + 4.0) / 0.5)
        assert row.last == last[down, right]
    assert result.table["density"].sum() * 0.25 * recording_frames(analysis) == pytest.approx(
        len(analysis.tracks.table)
    )


def recording_frames(analysis):
    return analysis.tracks.recording.steps


def test_times_ways_and_waiting_are_those_of_the_tracks(tmp_path):
    steps = np.arange(200)
    x = np.column_stack([-3.0 + 0.1 * np.minimum(steps, 50.0), np.where(steps < 100, -3.0, -3.0 + 0.1 * (steps - 100))])
    y = np.zeros_like(x)
    x[150:, 0], x[160:, 1] = np.nan, np.nan
    y[np.isnan(x)] = np.nan
    with write_tracks(tmp_path / "two.h5", x, y) as recording:
        analysis = analyze(recording, only=["evacuation", "groups"])
        table = characters(analysis.tracks)
        np.testing.assert_allclose(table["travel_time"], [15.0, 16.0])
        np.testing.assert_allclose(table["way"], [5.0, 5.9], atol=1e-4)
        np.testing.assert_allclose(table["detour"], [1.0, 1.0], atol=1e-4)
        np.testing.assert_allclose(table["waiting"], [9.6, 9.6], atol=0.3)
        values = result_of(analysis, "evacuation").values
        assert (values["t50"], values["t95"], values["left_at_the_end"]) == (15.0, 16.0, {})


def test_who_is_left_is_told_by_group(recording, tmp_path):
    x, y = random_walkers(6, 100)
    x[:, 1], y[:, 1] = -2.0, 0.0
    with write_tracks(tmp_path / "left.h5", x, y) as stays:
        result = result_of(analyze(stays, only=["evacuation"]), "evacuation")
    assert 1 in result.values["agents_left_at_the_end"]
    assert result.values["left_at_the_end"]["left"] >= 1
    assert result.values["t95"] is None
    assert "95 % never have." in result.sentences


def test_a_line_of_a_periodic_floor_counts_each_round_and_speeds_do_not_jump(tmp_path):
    steps = np.arange(300)
    x = ((-3.0 + 0.12 * steps + 4.0) % 8.0 - 4.0)[:, None]
    header = hall_header(1, Ends(0, -4.0, 4.0))
    with write_tracks(tmp_path / "ring.h5", x, np.zeros_like(x), header) as ring:
        analysis = analyze(ring)
    passed = int(((-3.0 + 0.12 * 299) + 8.0) // 8.0)
    assert result_of(analysis, "flow").values["across"]["passages"] == passed
    assert analysis.tracks.table["speed"].max() == pytest.approx(1.2, abs=1e-3)
    assert characters(analysis.tracks)["way"].iloc[0] == pytest.approx(0.12 * 299, abs=1e-3)


def test_distances_reach_across_the_ends_of_a_periodic_floor():
    frame = np.array([0, 0, 0, 1])
    places = np.array([[-3.9, 0.0], [3.8, 0.0], [0.0, 0.0], [-3.9, 0.1]])
    found = nearest_distances(frame, places, Ends(0, -4.0, 4.0))
    np.testing.assert_allclose(found[:3], [0.3, 0.3, 3.8])
    assert np.isinf(nearest_distances(frame, places)[3])
    for rows in range(3):  # each alone in its frame: the nearest other is the agent itself, one length away
        alone = np.arange(rows), places[:rows]
        assert nearest_distances(*alone, Ends(0, -4.0, 4.0)).tolist() == [8.0] * rows
        assert nearest_distances(*alone).tolist() == [np.inf] * rows


@pytest.mark.parametrize("case", ["nobody", "one", "one step", "outside"])
def test_odd_recordings_end_in_words(case, tmp_path):
    x, y = random_walkers(1 if case.startswith("one") else 3, 80)
    if case == "nobody":
        x, y = np.full_like(x, np.nan), np.full_like(y, np.nan)
    if case == "one step":
        x, y = np.zeros((1, 1)), np.zeros((1, 1))
    header = hall_header(x.shape[1])
    if case == "outside":
        header = replace(header, areas=(ShapeRecord("corner", box(3.9, 2.4, 4.0, 2.5).wkt),), lines=())
    with write_tracks(tmp_path / "odd.h5", x, y, header) as recording:
        analysis = analyze(recording)
        files = write_analysis(analysis, tmp_path / "out")
    assert [result.name for result in analysis.results] == list(MEASUREMENTS)
    assert all(result.sentences for result in analysis.results)
    text = files[-1].read_text(encoding="utf-8")
    words = {
        "nobody": "Nobody was present",
        "one": "Nobody was ever with another",
        "one step": "Nobody was ever with another",
        "outside": "Nobody was in an area.",
    }
    assert words[case] in text
    values = json.loads((tmp_path / "out" / "analysis.json").read_text(encoding="utf-8"))
    assert set(MEASUREMENTS) <= set(values)


def test_all_files_are_written_and_the_same_again(analysis, tmp_path):
    first = write_analysis(analysis, tmp_path / "a")
    second = write_analysis(analyze(analysis.tracks.recording), tmp_path / "b")
    names = [file.name for file in first]
    assert names == [file.name for file in second]
    assert {f"{name}.{ending}" for name in MEASUREMENTS for ending in ("csv", "png")} <= set(names)
    for one, other in zip(first, second, strict=True):
        if one.suffix != ".png":
            assert one.read_bytes() == other.read_bytes(), one.name


def test_more_places_may_be_named(recording):
    analysis = analyze(recording, lines=["late=2,-2.5,2,0,2,2.5"], areas=["left=-3,-2,-2,2"], only=["flow", "service"])
    assert set(analysis.places.areas) == {"middle", "left"}
    values = analysis.values()
    assert values["flow"]["late"]["passages"] == 40
    assert sum(values["service"][WALKWAYS.name]["left"].values()) == pytest.approx(1.0)
    assert "diagram" not in values


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"lines": ["door=1,2,3"]}, "expected name=x0,y0,x1,y1"),
        ({"lines": ["door=1,2,1,2"]}, "two points lie on each other"),
        ({"lines": ["across=0,0,1,1"]}, "a place 'across' already"),
        ({"areas": ["here=0,0,1,1,1,0,0,1"]}, "enclose no area"),
        ({"only": ["flows"]}, "no measurement 'flows'"),
        ({"rate": 7.0}, "would need interpolation"),
        ({"voronoi_rate": 0.0}, "is below 0.001"),
        ({"voronoi_rate": 1e-320}, "is below 0.001"),
        ({"voronoi_rate": float("nan")}, "is below 0.001"),
    ],
)
def test_wrong_options_are_refused(recording, options, words):
    with pytest.raises(CrowdSimError, match=words):
        analyze(recording, **options)


def test_areas_that_pedpy_does_not_take_are_told(tmp_path):
    bent = "POLYGON ((-2 -2, 2 -2, 2 2, 1 2, 1 -1, -2 -1, -2 -2))"
    header = replace(hall_header(3), areas=(ShapeRecord("bent", bent),))
    with write_tracks(tmp_path / "bent.h5", *random_walkers(3, 80), header) as recording:
        result = result_of(analyze(recording, only=["diagram"]), "diagram")
    assert any("bent is not convex" in text for text in result.sentences)


def test_a_floor_of_two_parts_is_measured_where_people_walk(tmp_path):
    parts = MultiPolygon([box(-4.0, -2.5, 3.0, 2.5), box(3.1, -2.5, 4.0, 2.5)]).wkt
    header = replace(hall_header(5), walkable=(parts, parts))
    with write_tracks(tmp_path / "parts.h5", *random_walkers(5, 150), header) as recording:
        analysis = analyze(recording)
    assert analysis.tracks.walkable.bounds == (-4.0, -2.5, 3.0, 2.5)
    assert any("PedPy takes one" in note for note in analysis.tracks.notes)


def test_tables_of_people_hold_what_their_sources_say():
    assert weidmann_speed(5.4) == pytest.approx(0.0)
    assert weidmann_speed(1.0) == pytest.approx(1.34 * (1.0 - np.exp(-1.913 * (1.0 - 1.0 / 5.4))))
    assert flow_band(1.2).least == 1.69
    assert flow_band(0.39) is None
    assert flow_band(5.1) is None
    assert all(a.widest == b.narrowest for a, b in itertools.pairwise(FLOW_BANDS))
    np.testing.assert_allclose(WALKWAYS.least_areas, [3.25, 2.32, 1.39, 0.93, 0.46], atol=0.006)
    np.testing.assert_allclose(QUEUES.least_areas, [1.21, 0.93, 0.65, 0.28, 0.19], atol=0.006)


def test_levels_weigh_people():
    shares = level_shares(np.array([0.2, 0.2, 0.4, 3.0]), WALKWAYS)
    assert shares == pytest.approx({"A": 0.4 / 3.8, "B": 0.4 / 3.8, "C": 0, "D": 0, "E": 0, "F": 3.0 / 3.8})
