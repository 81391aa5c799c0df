"""Cells as pandas, R and spreadsheets write them: missing numbers, quotes, True and False."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from draglag.errors import DataError
from draglag.exchange.importers import parse_map
from draglag.exchange.importers.columns import read_laser_columns
from draglag.exchange.streams import read_laser, read_touch
from draglag.exchange.tables import column_names, line_of_row, read_events, read_table

TOUCH = ("t_s", "x_mm", "y_mm")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.csv"


@pytest.mark.parametrize("cell", ["", " ", "NA", "na", "NaN", "nan", '""', '"NA"'])
def test_a_missing_number_leaves_out_its_row_and_no_other(path: Path, cell: str) -> None:
    path.write_text(f"t_s,x_mm,y_mm\n10.0,1,2\n10.1,{cell},4\n10.2,5,6\n", "utf-8")
    np.testing.assert_array_equal(read_table(path, TOUCH), [[10.0, 1, 2], [10.1, np.nan, 4], [10.2, 5, 6]])
    touch, said = read_touch(path)
    assert touch.t_s.tolist() == [10.0, 10.2]
    assert said == ["a.csv: 1 rows hold no number and are left out, the first in line 3"]


@pytest.mark.parametrize("cell", ["abc", "N", "1,5", "-", "True", '"a b"'])
def test_another_text_in_place_of_a_number_is_refused_with_its_line(path: Path, cell: str) -> None:
    path.write_text(f't_s,x_mm,y_mm\n10.0,,2\n10.1,"{cell}",4\n'.replace('""', '"'), "utf-8")
    with pytest.raises(DataError, match=r"a\.csv, line 3: expected a number for x_mm, found “"):
        read_touch(path)


def test_a_column_that_is_not_asked_for_may_hold_text(path: Path) -> None:
    path.write_text('t_s,note,x_mm,y_mm\n10.0,"up, then down",1,2\n10.1,fine,3,4\n', "utf-8")
    np.testing.assert_array_equal(read_table(path, TOUCH), [[10.0, 1, 2], [10.1, 3, 4]])
    np.testing.assert_array_equal(read_events(path, TOUCH), [[10.0, 1, 2], [10.1, 3, 4]])


QUOTED = '"x, mm","t_s","what ""it"" is"\n# a 5" panel\n"1.5","0.1","one, two"\n\n2.5,0.2,"a\nb"\n 3.5, 0.3 , "c, d"\n'


def test_cells_in_quotes_hold_separators_and_line_ends(path: Path) -> None:
    path.write_text(QUOTED, "utf-8")
    assert column_names(path)[:2] == ("x, mm", "t_s")
    np.testing.assert_array_equal(read_events(path, ("t_s", "x, mm")), [[0.1, 1.5], [0.2, 2.5], [0.3, 3.5]])
    assert [line_of_row(path, row, notes=True) for row in range(3)] == [3, 5, 7]
    path.write_text('"t;s";"x"\n"0,5";"1,25"\n', "utf-8")
    np.testing.assert_array_equal(read_events(path, ("t;s", "x")), [[0.5, 1.25]])


def test_quotes_that_do_not_end_are_refused_with_their_line(path: Path) -> None:
    path.write_text('t_s,x_mm,y_mm\n10.0,1,2\n10.1,"3,4\n' + "10.2,5,6\n" * 3, "utf-8")
    for read in (read_table, read_events):
        with pytest.raises(DataError, match=r"a\.csv, line 3: expected 3 (numbers|cells) \(t_s,x_mm,y_mm\), found 2"):
            read(path, TOUCH)
    # A cell of more than Python's csv module takes.
    path.write_text('t_s,x_mm,y_mm\n10.0,1,2\n10.1,"3,4\n' + "10.2,5,6\n" * 20_000, "utf-8")
    for read in (read_table, read_events):
        with pytest.raises(DataError, match=r"a\.csv, line 3: its quotes do not end. Correct that line\."):
            read(path, TOUCH)


@pytest.mark.parametrize(("on", "off"), [("True", "False"), ("TRUE", "false"), ('"True"', '"False"')])
def test_light_may_be_true_or_false(path: Path, on: str, off: str) -> None:
    path.write_text(f"t_s,light\n10.0,{off}\n10.1,{on}\n10.2,{off}\n", "utf-8")
    laser, said = read_laser(path)
    assert (laser.light.tolist(), said) == ([0, 1, 0], [])
    assert read_laser_columns(path, parse_map(())).light.tolist() == [0, 1, 0]
    path.write_text(f"when,beam\n10.0,{off}\n10.1,{on}\n10.2,{off}\n", "utf-8")
    assert read_laser_columns(path, parse_map(["laser.t=when", "laser.light=beam"])).light.tolist() == [0, 1, 0]
    # In a column of numbers they are none.
    assert np.isnan(read_events(path, ("beam",))).all()
