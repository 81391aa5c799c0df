"""Which column is which: one of a name, one to a key."""

from __future__ import annotations

from pathlib import Path

import pytest

from draglag.errors import DataError
from draglag.exchange.importers import HowToRead, parse_map, read_recordings
from draglag.exchange.importers.columns import read_laser_columns
from draglag.exchange.streams import read_laser, read_touch
from draglag.recording import Screen

SCREEN = Screen("s", 300.0, 200.0, 1920, 1080)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.csv"


def test_of_two_columns_of_one_name_none_is_chosen(path: Path) -> None:
    path.write_text("# by hand\nt_s,x_mm,y_mm,x_mm\n1,2,3,9\n", "utf-8")
    with pytest.raises(DataError) as refused:
        read_recordings((path,), HowToRead("csv", screen=SCREEN))
    assert str(refused.value) == f"{path}, line 2: there are 2 columns x_mm. Give each column a name of its own."
    path.write_text("t_s,light,light\n1,0,1\n", "utf-8")
    for read in (lambda one: read_laser_columns(one, parse_map(())), read_laser):
        with pytest.raises(DataError, match=r"a\.csv, line 1: there are 2 columns light\."):
            read(path)
    for cells in ("1,2,3,9", "1,2,3,"):  # numbers alone, and read cell by cell
        path.write_text(f"t_s,x_mm,y_mm,x_mm\n{cells}\n", "utf-8")
        with pytest.raises(DataError, match=r"a\.csv, line 1: there are 2 columns x_mm\."):
            read_touch(path)


def test_columns_that_are_not_asked_for_may_share_a_name(path: Path) -> None:
    path.write_text("t_s,x_mm,y_mm,,\n1,2,3,8,9\n", "utf-8")
    assert read_recordings((path,), HowToRead("csv", screen=SCREEN)).runs[0].touch.x_mm.tolist() == [2.0]
    assert read_touch(path)[0].x_mm.tolist() == [2.0]


@pytest.mark.parametrize(("first", "second"), [("t=A", "t=B"), ("clock=1", "clock=1"), ("stream=A", "stream=B")])
def test_a_key_is_mapped_once(first: str, second: str) -> None:
    with pytest.raises(DataError) as refused:
        parse_map([first, "x=X", second])
    key = first.partition("=")[0]
    assert str(refused.value) == f"--map {second}: {key} is mapped twice. Map each key once."
