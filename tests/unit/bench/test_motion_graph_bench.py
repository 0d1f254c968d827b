"""The motion graph benchmark on the default set: one row a graph and size, and figures of the same."""

from crowdsim.bench.motion_graph import measure


def test_rows_and_figures_of_both_graphs() -> None:
    measured = measure(sizes=(693,))
    assert [row["graph"] for row in measured.rows] == ["standard", "features"]
    for row in measured.rows:
        assert row["frames"] == 693
        assert row["nodes"] > 0
        assert row["edges"] >= row["transitions"] > 0
        assert 1.0 < row["branching"] < 2.0
        assert measured.figures[f"{row['graph']}_693_nodes"] == row["nodes"]
    assert measured.rows[0]["nodes"] > measured.rows[1]["nodes"]
