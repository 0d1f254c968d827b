"""The motion graph benchmark on the built-in sets: one row a set, graph and size, and figures of the same."""

from crowdsim.bench.motions.motion_graph import measure


def test_rows_and_figures_of_both_graphs() -> None:
    measured = measure(sizes=(693,))
    kinds = [(row["set"], row["graph"]) for row in measured.rows]
    assert kinds == [(name, graph) for name in ("default", "happy", "dance") for graph in ("standard", "features")]
    for row in measured.rows:
        assert row["frames"] == 693
        assert row["nodes"] > 0
        assert row["edges"] >= row["transitions"] > 0
        assert 1.0 < row["branching"] < 2.0
        assert 0.0 <= row["added_drift_cm"] <= row["across_drift_cm"]
        assert row["clip_drift_cm"] <= 1.0
        if row["graph"] == "features":
            assert row["across_drift_cm"] <= 1.0
        assert measured.figures[f"{row['set']}_{row['graph']}_693_nodes"] == row["nodes"]
    assert measured.rows[0]["nodes"] > measured.rows[1]["nodes"]
