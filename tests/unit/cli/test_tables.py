"""Tables on stdout."""

from crowdsim.cli.tables import print_rows


def test_a_table_has_a_header_and_empty_cells_for_none(capsys):
    print_rows([{"name": "door", "width": 1.5}, {"name": "gap", "width": None}])
    assert capsys.readouterr().out == "name  width\ndoor    1.5\ngap\n"


def test_a_table_without_rows_prints_nothing(capsys):
    print_rows([])
    assert capsys.readouterr().out == ""
