"""Which column is which: one of a name, one to a key."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from draglag.errors import DataError
from draglag.exchange.importers import HowToRead, parse_map, read_recordings
from draglag.exchange.importers.columns import read_laser_columns
from draglag.exchange.streams import read_laser, read_touch
from draglag.exchange.tables import read_events
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


def contacts(path: Path, ids: list[str], step_s: float = 0.01) -> tuple[list[int], list[str]]:
    """The numbers of the contacts of events ``step_s`` apart, and what the import says of the run."""
    rows = "".join(f"{step_s * k:.3f};{k},5;3;{name}\n" for k, name in enumerate(ids))
    path.write_text("t_s;x_mm;y_mm;finger\n" + rows, "utf-8")
    (run,) = read_recordings((path,), HowToRead("csv", screen=SCREEN, map=parse_map(["contact=finger"]))).runs
    return run.touch.contact_id.tolist(), [note.text for note in run.log]


@pytest.mark.parametrize(
    ("ids", "read"),
    [
        (["a", "a", "b", "a"], [0, 0, 1, 0]),
        (["left", "1", "", "2"], [0, 1, -1, 2]),
        (["7", "7,0", "NA", "9"], [7, 7, -1, 9]),
    ],
)
def test_contacts_are_numbers_or_names(path: Path, ids: list[str], read: list[int]) -> None:
    assert contacts(path, ids)[0] == read


@pytest.mark.parametrize("odd", ["1,7", "inf", "1e300"])
def test_a_contact_that_is_no_whole_number_is_refused(path: Path, odd: str) -> None:
    with pytest.raises(DataError, match=r"a\.csv, line 3: .* is no number of a contact\. Map the column that numbers"):
        contacts(path, ["1", odd, "2"])


def test_contacts_at_once_are_said_and_contacts_in_turn_are_not(path: Path, tmp_path: Path) -> None:
    said = "a.csv: several contacts touch at the same time, and draglag measures one stylus: keep the rows of one"
    assert said in contacts(path, ["a", "b", "a", "b"])[1]
    for apart in (["a", "a", "b", "b", "c"], ["a", "", "a"]):
        assert said not in contacts(path, apart)[1]
    # A panel that counts its fingers from 0: the same number again, later.
    assert said not in contacts(path, ["0", "1", "0"], step_s=0.2)[1]


@pytest.mark.parametrize("between", [";", "\t"])
def test_commas_are_decimal_where_other_marks_stand_between_the_cells(path: Path, between: str) -> None:
    path.write_text("\n".join([between.join(row) for row in (("t", "x"), ("0,5", "1,25"), ("0.75", "2"))]), "utf-8")
    np.testing.assert_array_equal(read_events(path, ("t", "x")), [[0.5, 1.25], [0.75, 2.0]])
