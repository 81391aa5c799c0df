"""XDF files that are damaged, or claim what they do not hold: refused, or read with what is missing said."""

from __future__ import annotations

import gzip
import logging
import os
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from core.xdf_files import BOUNDARY, clock, head, samples, xdf_file
from draglag.errors import DataError
from draglag.exchange.importers import HowToRead, parse_map, read_recordings
from draglag.recording import Screen, Session

pytest.importorskip("pyxdf", reason="pyxdf is not installed")
T_S = np.arange(20) * 0.01
ROWS = np.column_stack([T_S * 100, T_S * 50])
TOUCH = (head(1, "panel", ["x_mm", "y_mm"]), samples(1, T_S[:10], ROWS[:10]), BOUNDARY, samples(1, T_S[10:], ROWS[10:]))
SCREEN = Screen("s", 300.0, 200.0, 1920, 1080)
# Far above what reading a kilobyte takes, far below what a claim of millions of samples does.
ROOM_BYTES = 20e6


def read(folder: Path, data: bytes, *mapped: str) -> Session:
    (folder / "a.xdf").write_bytes(data)
    return read_recordings((folder / "a.xdf",), HowToRead(screen=SCREEN, map=parse_map(mapped)))


def warnings(session: Session) -> str:
    return "; ".join(entry.text for entry in session.runs[0].log)


def test_a_recording_that_was_cut_off_gives_what_it_holds(tmp_path: Path) -> None:
    session = read(tmp_path, xdf_file(TOUCH)[:-5])
    np.testing.assert_array_equal(session.runs[0].touch.t_s, T_S[:10])
    assert "1 pieces of the file are damaged or cut off" in warnings(session)


def test_after_damage_reading_goes_on_at_the_next_boundary(tmp_path: Path) -> None:
    whole = xdf_file(TOUCH)
    at = whole.index(samples(1, T_S[:10], ROWS[:10])) - 5  # its length
    session = read(tmp_path, whole[:at] + b"\x07" + whole[at + 1 :])
    np.testing.assert_array_equal(session.runs[0].touch.t_s, T_S[10:])
    assert "damaged" in warnings(session)
    assert "damaged" not in warnings(read(tmp_path, whole))


@pytest.mark.parametrize(
    "chunk",
    [
        samples(1, T_S[:1], ROWS[:1], count=2**40),
        samples(1, T_S[:10], ROWS[:10], count=9),
        samples(1, T_S[:1], ROWS[:1]).replace(struct.pack("<Bd", 8, 0.0), b"\x09" + bytes(8)),
        head(2, "wide", ["x"], count=10**12),
        head(2, "narrow", ["x"], count=-1),
        head(2, "texts", ["x"], kind="string"),
        head(2, "odd", ["x"], kind="int3"),
        head(2, "laughs", ["x"]).replace(b"?><info>", b'?><!DOCTYPE x [<!ENTITY a "aaaa">]><info>'),
        head(1, "again", ["x"]),
        samples(9, T_S[:1], ROWS[:1]),
        clock(1, float("nan"), 0.0),
        struct.pack("<HI", 6, 1) + b"<info",
        struct.pack("<H", 2) + b"\x01",
    ],
)
def test_a_chunk_that_claims_what_it_does_not_hold_takes_no_memory_and_spoils_no_other(
    tmp_path: Path, chunk: bytes
) -> None:
    more = b"" if b"wide" not in chunk else struct.pack("<HIBB", 3, 2, 1, 1) + b"\x00"
    tracemalloc.start()
    session = read(tmp_path, xdf_file([*TOUCH, chunk, more or BOUNDARY]))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    np.testing.assert_array_equal(session.runs[0].touch.x_mm, ROWS[:, 0])
    assert ("damaged" in warnings(session)) == (b"texts" not in chunk)
    assert peak < ROOM_BYTES


def test_labels_of_channels_that_are_not_there_are_no_channels(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="holds no stream of touch"):
        read(tmp_path, xdf_file([head(1, "panel", ["a", "x_mm", "y_mm"], count=2), samples(1, T_S, ROWS)]))


def test_clocks_are_followed_across_a_restart_and_not_across_hundreds(tmp_path: Path) -> None:
    """The stream's computer starts again after 10 s: its clock begins at 0, and the recorder's goes on."""
    clocks = [clock(1, 1000.0 + 2.5 * k, 0.0) for k in range(5)] + [clock(1, 2.5 * k, 1015.0) for k in range(5)]
    stamps = np.concatenate([1000.0 + np.arange(10), np.arange(10)])
    session = read(tmp_path, xdf_file([TOUCH[0], *clocks, samples(1, stamps, ROWS)]))
    np.testing.assert_allclose(session.runs[0].touch.t_s, 1000.0 + np.r_[0:10, 15:25], atol=1e-6)
    assert "segments" in warnings(session)
    clocks = [clock(1, 0.0, 5.0 * (k % 2)) for k in range(200)]
    with pytest.raises(DataError, match="its clocks were set more than 100 times"):
        read(tmp_path, xdf_file([TOUCH[0], *clocks, *TOUCH[1:]]))


def test_what_the_library_warns_of_is_said_in_the_session_and_not_on_the_screen(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def load(*_: object, **__: object) -> None:
        logging.getLogger("pyxdf.pyxdf").warning("clock offsets cannot be used")
        raise ZeroDivisionError("two\nlines")

    monkeypatch.setattr("pyxdf.load_xdf", load)
    with pytest.raises(DataError) as refused:
        read(tmp_path, xdf_file(TOUCH))
    assert "ZeroDivisionError: two lines" in str(refused.value)
    assert capfd.readouterr() == ("", "")


def test_what_is_no_regular_file_or_unpacks_without_bound_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.xdf")
    with pytest.raises(DataError, match="is not a regular file"):
        read_recordings((tmp_path / "pipe.xdf",), HowToRead(screen=SCREEN))
    with pytest.raises(DataError, match="unpacks to more than"):
        read(tmp_path, gzip.compress(b"XDF:" + bytes(2**25)))
    with pytest.raises(DataError, match="is not an XDF file"):
        read(tmp_path, b"")
