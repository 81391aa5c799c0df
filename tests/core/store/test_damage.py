"""Killed recordings are saved, and damaged or hostile files get one clear error."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pytest

from core.store_sessions import assert_same, full_session
from draglag.errors import DataError
from draglag.store import SessionWriter, clear_leftovers, partial_files, read_session, salvage, verify, write_session

RECORDER = """
import sys
import numpy as np
from draglag.recording import *
from draglag.store import SessionWriter

writer = SessionWriter(sys.argv[1], Session("k", Screen("s", 300.0, 200.0, 1024, 768), Stylus(7.0), ()))
for run_id in ("run-01", "run-02"):
    writer.begin_run(Run(run_id, "circle", 0.0, 9.0, empty_touch(), empty_laser(), 44.0))
    for batch in range(5):
        t_s = batch + np.arange(50) * 0.01
        writer.append_touch(run_id, TouchTrace(t_s, 2 * t_s, 3 * t_s))
        writer.append_laser(run_id, LaserTrace(t_s[:2], np.array([0, 1])))
        writer.flush()
    if run_id == "run-01":
        writer.end_run(run_id, "complete")
writer.append_touch("run-02", TouchTrace(t_s + 1, t_s, t_s))
print("flushed", flush=True)
sys.stdin.read()
"""


def test_a_killed_recording_gives_back_all_that_was_flushed(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    child = subprocess.Popen(
        [sys.executable, "-c", RECORDER, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "flushed\n"
    os.kill(child.pid, signal.SIGKILL)
    child.communicate()

    assert partial_files(tmp_path) == [tmp_path / "s.h5.partial"]
    saved = salvage(tmp_path / "s.h5.partial")
    assert saved.path == path
    assert saved.losses == ()
    session = read_session(path)
    t_s = np.concatenate([batch + np.arange(50) * 0.01 for batch in range(5)])
    assert [run.outcome for run in session.runs] == ["complete", "aborted"]
    for run in session.runs:
        np.testing.assert_array_equal(run.touch.t_s, t_s)
        np.testing.assert_array_equal(run.touch.y_mm, 3 * t_s)
        assert len(run.laser.t_s) == 10
    assert "saved from s.h5.partial" in session.notes[-1].text
    assert (tmp_path / "s.h5.partial").exists()
    assert partial_files(tmp_path) == []


def test_salvage_takes_a_sound_file_as_it_is(tmp_path: Path) -> None:
    write_session(full_session(), tmp_path / "s.h5")
    saved = salvage(tmp_path / "s.h5", tmp_path / "t.h5")
    assert_same(saved.session.runs, full_session().runs)
    assert saved.losses == ()


def test_salvage_overwrites_nothing(tmp_path: Path) -> None:
    write_session(full_session(), tmp_path / "s.h5.partial")
    (tmp_path / "s.h5").write_text("precious")
    with pytest.raises(DataError, match="not overwritten"):
        salvage(tmp_path / "s.h5.partial")
    assert (tmp_path / "s.h5").read_text() == "precious"


def test_salvage_into_a_missing_folder_asks_for_the_folder_not_for_room(tmp_path: Path) -> None:
    SessionWriter(tmp_path / "s.h5", full_session()).abandon()
    with pytest.raises(DataError, match=r"no such folder\. Make it first"):
        salvage(tmp_path / "s.h5.partial", tmp_path / "missing" / "t.h5")


def test_salvage_of_hdf5_leaves_out_unfinished_rows_and_keeps_the_rest_of_a_broken_run(tmp_path: Path) -> None:
    path = tmp_path / "s.h5.partial"
    session = full_session()
    write_session(session, path)
    with h5py.File(path, "r+") as file:
        for name in ("x_mm", "y_mm", "contact_id"):  # written before the scale, when the writer died
            file[f"runs/run-01/touch/{name}"].resize((250,))
        del file["runs/run-02/laser"]
        del file["runs/run-02/touch/x_raw"]
        del file["runs/run-02/touch/y_mm"]
    saved = salvage(path)
    assert [run.id for run in saved.session.runs] == ["run-01", "run-02"]
    np.testing.assert_array_equal(saved.session.runs[0].touch.x_mm, session.runs[0].touch.x_mm)
    broken = saved.session.runs[1]
    np.testing.assert_array_equal(broken.touch.t_s, session.runs[1].touch.t_s)
    np.testing.assert_array_equal(broken.touch.x_mm, session.runs[1].touch.x_mm)
    assert np.isnan(broken.touch.y_mm).all()
    assert len(broken.laser.t_s) == 0
    assert any("50 unfinished rows" in loss for loss in saved.losses)
    assert any("run-02: laser is lost" in loss for loss in saved.losses)
    assert any("y_mm: 200 of 200 values are lost" in loss for loss in saved.losses)
    assert "Record again" not in " ".join(saved.losses)


def test_an_unfinished_hdf5_file_of_the_first_recordings_is_saved(tmp_path: Path) -> None:
    """They were recorded into HDF5, without a checksum until they were closed."""
    path, session = tmp_path / "s.h5.partial", full_session()
    write_session(session, path)
    with h5py.File(path, "r+") as file:
        del file.attrs["raw_sha256"]
        file["runs/run-02"].attrs["outcome"] = np.bytes_(b"recording")
        del file["runs/run-02"].attrs["duration_s"]
    assert partial_files(tmp_path) == [path]
    saved = salvage(path)
    assert [run.outcome for run in saved.session.runs] == ["complete", "aborted"]
    for run, recorded in zip(saved.session.runs, session.runs, strict=True):
        assert_same(run.touch, recorded.touch)
        assert_same(run.laser, recorded.laser)
    assert saved.losses == ("run run-02: duration_s is lost, it was estimated from the samples",)


def test_only_leftovers_of_recordings_are_cleared(tmp_path: Path) -> None:
    """Not a journal of which the session file lacks something, not one that is being recorded, no file of others."""
    kept = SessionWriter(tmp_path / "live.h5", full_session())
    for name in ("whole", "other", "alone"):
        SessionWriter(tmp_path / f"{name}.h5", full_session()).abandon()
    SessionWriter(tmp_path / "closed.h5", full_session()).close()
    (tmp_path / "closed.h5").rename(tmp_path / "whole.h5")
    write_session(full_session(), tmp_path / "other.h5")
    with h5py.File(tmp_path / "other.h5", "r+") as file:
        file["runs/run-01/touch/x_mm"][0] += 1
    for name in (".notes.tmp", ".s.h5.tmp", "s.h5.1234abcd.tmp", ".s.h5.1234abcd.tmp"):
        (tmp_path / name).write_text("")
    before = {path.name for path in tmp_path.iterdir()}
    gone = {path.name for path in clear_leftovers(tmp_path)}
    assert gone == {"whole.h5.partial", ".s.h5.1234abcd.tmp"}
    assert {path.name for path in tmp_path.iterdir()} == before - gone
    kept.close()


def _external(file: h5py.File) -> None:
    file["runs/run-01/extra"] = h5py.ExternalLink("/etc/passwd", "/")


def _soft(file: h5py.File) -> None:
    del file["runs/run-01/touch/x_mm"]
    file["runs/run-01/touch/x_mm"] = h5py.SoftLink("/runs/run-01/touch/y_mm")


def _cycle(file: h5py.File) -> None:
    file["runs/run-01/again"] = file["runs"]


def _text_for_numbers(file: h5py.File) -> None:
    del file["runs/run-01/touch/x_mm"]
    file["runs/run-01/touch"].create_dataset("x_mm", data=np.array([b"a"] * 200, "S1"))


def _variable_length(file: h5py.File) -> None:
    file["runs/run-01/touch"].create_dataset("more", (1,), h5py.vlen_dtype(np.int32))


def _compound(file: h5py.File) -> None:
    file["runs/run-01/touch"].create_dataset("more", (1,), np.dtype([("a", "f8")]))


def _absurd(file: h5py.File) -> None:
    del file["runs/run-01/touch/x_mm"]
    file["runs/run-01/touch"].create_dataset("x_mm", (2**40,), "f8", chunks=(1024,))


def _bomb(file: h5py.File) -> None:
    file["runs/run-01/touch"].create_dataset("more", (2**27,), "f8", chunks=(2**20,))


def _two_dimensional(file: h5py.File) -> None:
    del file["runs/run-01/touch/x_mm"]
    file["runs/run-01/touch"].create_dataset("x_mm", data=np.zeros((200, 2)))


def _external_storage(file: h5py.File) -> None:
    del file["runs/run-01/touch/x_mm"]
    file["runs/run-01/touch"].create_dataset("x_mm", (200,), "f8", external=[("/etc/passwd", 0, 1600)])


def _virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((200,), "f8")
    layout[:] = h5py.VirtualSource("/etc/passwd", "x", (200,))
    file["runs/run-01/touch"].create_virtual_dataset("more", layout)


def _uneven(file: h5py.File) -> None:
    file["runs/run-01/touch/x_mm"].resize((150,))


def _no_screen(file: h5py.File) -> None:
    del file["screen"]


def _group_for_column(file: h5py.File) -> None:
    del file["runs/run-01/touch/x_mm"]
    file["runs/run-01/touch"].create_group("x_mm")


def _column_for_group(file: h5py.File) -> None:
    del file["runs/run-01/touch"]
    file["runs/run-01/touch"] = np.zeros(3)


def _columns_for_runs(file: h5py.File) -> None:
    del file["runs"]
    file["runs"] = np.zeros(3)


def _text_for_a_width(file: h5py.File) -> None:
    file["screen"].attrs["width_mm"] = "wide"


def _array_for_a_width(file: h5py.File) -> None:
    file["screen"].attrs["width_mm"] = np.zeros(100)


def _future(file: h5py.File) -> None:
    file.attrs["schema_version"] = 99


def _other_format(file: h5py.File) -> None:
    del file.attrs["schema"]


HOSTILE: list[tuple[Callable[[h5py.File], None], str]] = [
    (_external, "link to another place"),
    (_soft, "link to another place"),
    (_cycle, "second name"),
    (_text_for_numbers, "expected <f8"),
    (_variable_length, "type no session file has"),
    (_compound, "type no session file has"),
    (_absurd, "claims"),
    (_bomb, "claims"),
    (_two_dimensional, "not a column"),
    (_external_storage, "another file"),
    (_virtual, "another file"),
    (_uneven, "rows"),
    (_no_screen, "screen is missing"),
    (_group_for_column, "not a column"),
    (_column_for_group, "touch is missing"),
    (_columns_for_runs, "runs"),
    (_text_for_a_width, "not a number"),
    (_array_for_a_width, "not one value"),
    (_future, "newer draglag"),
    (_other_format, "not a draglag session"),
]


@pytest.mark.parametrize(("harm", "message"), HOSTILE, ids=lambda value: getattr(value, "__name__", None))
def test_a_hostile_file_gets_one_clear_error(tmp_path: Path, harm: Callable[[h5py.File], None], message: str) -> None:
    path = tmp_path / "s.h5"
    write_session(full_session(), path)
    with h5py.File(path, "r+") as file:
        harm(file)
    with pytest.raises(DataError, match=message) as caught:
        read_session(path)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")
    assert caught.value.remedy
    assert any(finding.level == "error" for finding in verify(path))


@pytest.mark.parametrize("kept", [0.02, 0.5, 0.95])
def test_a_truncated_file_is_called_so(tmp_path: Path, kept: float) -> None:
    path = tmp_path / "s.h5"
    write_session(full_session(), path)
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * kept)])
    with pytest.raises(DataError, match="is truncated: the end"):
        read_session(path)


def test_damage_anywhere_is_either_refused_or_noticed_or_harmless(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    session = full_session()
    write_session(session, path)
    data = np.frombuffer(path.read_bytes(), np.uint8)
    rng = np.random.default_rng(3)
    noticed = 0
    for _ in range(25):
        broken = data.copy()
        start = int(rng.integers(0, len(data)))
        broken[start : start + 64] = rng.integers(0, 256, len(broken[start : start + 64]))
        path.write_bytes(broken.tobytes())
        if any(finding.level == "error" for finding in verify(path)):
            noticed += 1
            with suppress(DataError):  # damage that only a checksum shows can still be read
                read_session(path)
        else:
            assert_same(read_session(path), session)
    assert noticed > 0


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89HDF\r\n\x1a\n" + b"\0" * 100])
def test_what_is_not_a_session_is_called_so(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "s.h5").write_bytes(content)
    with pytest.raises(DataError, match=r"s\.h5: is (not an HDF5 file|truncated)"):
        read_session(tmp_path / "s.h5")


def test_names_that_are_no_file_are_called_so(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        read_session(tmp_path / "none.h5")
    with pytest.raises(DataError, match="is not a file"):
        read_session(tmp_path)


def test_a_file_that_is_being_recorded_is_called_so(tmp_path: Path) -> None:
    child = subprocess.Popen(
        [sys.executable, "-c", RECORDER, str(tmp_path / "s.h5")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "flushed\n"
    try:
        with pytest.raises(DataError, match="another program is writing it"):
            salvage(tmp_path / "s.h5.partial")
    finally:
        child.kill()
        child.communicate()
