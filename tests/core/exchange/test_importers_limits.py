"""Every importer has the same limits, and refuses times that go back: one sentence that names the file."""

from __future__ import annotations

import gzip
import os
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path

import numpy as np
import pytest

from core.xdf_files import head, samples, xdf_file
from draglag.errors import DataError
from draglag.exchange.importers import HowToRead, parse_map, read_recordings, xdf_chunks
from draglag.exchange.importers.columns import read_laser_columns
from draglag.exchange.importers.walt import read_walt_laser
from draglag.reading import files
from draglag.recording import Screen

SCREEN = Screen("s", 300.0, 200.0, 1920, 1080)
EVDEV = ((3, 57, 7), (3, 53, 400), (3, 54, 800), (0, 0, 0))


def evemu(t_s: str) -> str:
    rows = "".join(f"E: {t_s} {kind:04x} {code:04x} {value}\n" for kind, code, value in EVDEV)
    return "N: panel\nA: 35 0 3999 0 0 40\nA: 36 0 1999 0 0 40\n" + rows


def evtest(t_s: str) -> str:
    rows = "".join(f"Event: time {t_s}, type {kind} (X), code {code} (X), value {v}\n" for kind, code, v in EVDEV[:-1])
    return rows + f"Event: time {t_s}, -------------- SYN_REPORT ------------\n"


def libinput(t_s: str) -> str:
    seconds, _, micro = t_s.partition(".")
    rows = "".join(f"    - [{seconds}, {micro}, {kind}, {code}, {value}]\n" for kind, code, value in EVDEV)
    return "# libinput record\ndevices:\n- node: x\n  events:\n  - evdev:\n" + rows


def table(t_s: str) -> str:
    return f"t_s,x_mm,y_mm\n{t_s},10,20\n"


def laser(t_s: str) -> str:
    return f"t_s,light\n{t_s},1\n"


def walt(t_s: str) -> str:
    return f"{t_s} 1\n"


def touch_of(kind: str) -> Callable[[Path], object]:
    return lambda path: read_recordings((path,), HowToRead(kind, screen=SCREEN, units_per_mm=40.0))


def laser_table(path: Path) -> object:
    return read_laser_columns(path, parse_map(()))


# How each format writes a sample at a time, and what reads it; a header is only in the first.
TEXTS = [
    pytest.param(evemu, touch_of("evemu"), id="evemu"),
    pytest.param(evtest, touch_of("evtest"), id="evtest"),
    pytest.param(libinput, touch_of("libinput"), id="libinput"),
    pytest.param(table, touch_of("csv"), id="table"),
    pytest.param(laser, laser_table, id="laser table"),
    pytest.param(walt, read_walt_laser, id="WALT's laser log"),
]
Write, Read = Callable[[str], str], Callable[[Path], object]


def two(write: Write, first: str, second: str) -> str:
    """Samples at two times, after one header."""
    lines = zip(write("1.0").split("\n"), write("2.0").split("\n"), strict=True)
    begin = sum(len(one) + 1 for one, _ in takewhile(lambda pair: pair[0] == pair[1], lines))
    return write(first) + write(second)[begin:]


@pytest.mark.parametrize(("write", "read"), TEXTS)
def test_times_that_go_back_are_refused_and_equal_ones_are_read(write: Write, read: Read, tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_text(two(write, "5.000000", "5.000000"), "utf-8")
    read(path)
    path.write_text(two(write, "5.000000", "4.999999"), "utf-8")
    with pytest.raises(DataError, match=r"go(es)? back") as refused:
        read(path)
    assert str(path) in str(refused.value)


@pytest.mark.parametrize(("write", "read"), TEXTS)
@pytest.mark.parametrize("t_s", ["9" * 400, "1" * 13 + ".5", "nan", "inf", "1e400", "-1e12", ""])
def test_a_time_that_cannot_be_is_refused(write: Write, read: Read, t_s: str, tmp_path: Path) -> None:
    (tmp_path / "a").write_text(two(write, "5.000000", t_s), "utf-8")
    with pytest.raises(DataError) as refused:
        read(tmp_path / "a")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("write", "read"), TEXTS)
def test_bytes_rows_and_lines_have_limits(
    write: Write, read: Read, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, text = tmp_path / "a", write("5.000000")
    path.write_text(text + "#" * 20_000, "utf-8")
    with pytest.raises(DataError, match="is longer than 10000 bytes"):
        read(path)
    path.write_bytes(gzip.compress(text.encode() + b"\n" * 2**25))
    with pytest.raises(DataError, match="unpacks to more than"):
        read(path)
    path.write_text(text + "\n" * 30, "utf-8")
    monkeypatch.setattr(files, "TABLE_ROWS", 20)
    with pytest.raises(DataError, match="has more than 20 lines"):
        read(path)
    monkeypatch.setattr(files, "TABLE_BYTES", 20)
    with pytest.raises(DataError, match="is longer than 20 bytes"):
        read(path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DataError, match="is not a regular file"):
        read(tmp_path / "pipe")


def test_the_lab_streaming_layer_has_the_same_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyxdf", reason="pyxdf is not installed")
    path, rows = tmp_path / "a.xdf", np.ones((20, 2))
    for stamps in (np.linspace(1.0, 0.0, 20), np.full(20, np.nan), np.full(20, 1e12), np.full(20, -np.inf)):
        path.write_bytes(xdf_file([head(1, "panel", ["x_mm", "y_mm"]), samples(1, stamps, rows)]))
        with pytest.raises(DataError, match=r"a\.xdf, stream panel: times must be numbers that never go back"):
            touch_of("xdf")(path)
    monkeypatch.setattr(xdf_chunks, "TABLE_ROWS", 19)
    with pytest.raises(DataError, match="has more than 19 samples or chunks"):
        touch_of("xdf")(path)
    monkeypatch.setattr(files, "TABLE_BYTES", 20)
    with pytest.raises(DataError, match="is longer than 20 bytes"):
        touch_of("xdf")(path)


@pytest.mark.parametrize(
    ("mapped", "message"),
    [
        ("clock=1e12", "expected a number of seconds, at most 1e"),
        ("laser.clock=" + "9" * 400, "expected a number of seconds"),
        ("laser.clock=nan", "expected a number of seconds"),
        ("laser.light=v:>" + "9" * 400, "is no unit of laser.light"),
        ("t=", "is not KEY=COLUMN"),
    ],
)
def test_a_map_of_absurd_numbers_is_refused(mapped: str, message: str) -> None:
    with pytest.raises(DataError) as refused:
        parse_map([mapped])
    assert message in str(refused.value)


def test_contacts_and_places_beyond_what_numbers_hold_are_refused_or_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t_s,x_mm,y_mm,id\n1,2,3,1e300\n", "utf-8")
    with pytest.raises(DataError, match=r"a\.csv, line 2: 1e\+300 is no number of a contact"):
        read_recordings((path,), HowToRead("csv", screen=SCREEN, map=parse_map(["contact=id"])))
    path.write_text("t_s,x_mm,y_mm,id\n1,2,3,\n2,1e308,3,1\n3,4,5,1\n", "utf-8")
    how = HowToRead("csv", screen=SCREEN, map=parse_map(["contact=id", "x=x_mm:m"]))
    (run,) = read_recordings((path,), how).runs
    assert (run.touch.t_s.tolist(), run.touch.contact_id.tolist()) == ([1.0, 3.0], [-1, 1])
    assert run.touch.dropped == 1


@pytest.mark.parametrize("axis", ["A: 35 3999 0 0 0 40", "A: 35 0 4000000000 0 0 40"])
def test_a_panel_that_cannot_be_is_asked_for(axis: str, tmp_path: Path) -> None:
    path = tmp_path / "a.events"
    path.write_text(evemu("1.000000").replace("A: 35 0 3999 0 0 40", axis), "utf-8")
    with pytest.raises(DataError, match=r"by its touchscreen, the screen is .* Give --screen"):
        read_recordings((path,))


def test_a_panel_that_does_not_say_its_size_has_that_of_its_axes(tmp_path: Path) -> None:
    """evemu writes 0x0 for it."""
    path = tmp_path / "a.events"
    path.write_text("# Size in mm: 0x0\n" + evemu("1.000000"), "utf-8")
    session = read_recordings((path,))
    assert (session.screen.width_mm, session.screen.height_mm) == (100.0, 50.0)
    assert session.runs[0].touch.x_mm.tolist() == [10.0]
