"""Session files keep everything, stay readable for other programs and are never overwritten."""

from __future__ import annotations

import errno
import gzip
import os
import subprocess
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from core.store_sessions import assert_same, bare_session, full_run, full_session, touch
from draglag.errors import DataError
from draglag.recording import ClockBounds, LaserTrace, LogEntry, Run, TouchTrace, empty_laser, empty_touch
from draglag.store import (
    SessionWriter,
    add_analysis,
    migrate,
    read_analyses,
    read_session,
    read_with_state,
    verify,
    write_session,
)

DATA = Path(__file__).parents[2] / "data"


def test_a_session_comes_back_as_it_went(tmp_path: Path) -> None:
    session = full_session()
    write_session(session, tmp_path / "s.h5")
    assert_same(read_session(tmp_path / "s.h5"), session)


def test_a_session_without_anything_optional_comes_back(tmp_path: Path) -> None:
    session = bare_session(Run("r", "free", 0.0, 1.0, empty_touch(), empty_laser()))
    write_session(session, tmp_path / "s.h5")
    assert_same(read_session(tmp_path / "s.h5"), session)


def test_recording_in_batches_gives_the_same_file_content_as_writing_at_once(tmp_path: Path) -> None:
    whole = full_session()
    header = replace(whole, runs=(), notes=(), taps=None, clocks=())
    with SessionWriter(tmp_path / "live.h5", header) as writer:
        for run in whole.runs:
            first = replace(
                run, touch=_rows(run.touch, 0, 1), laser=_edges(run.laser, 0, 1), display=None, sync=(), log=()
            )
            writer.begin_run(replace(first, duration_s=99.0))
            for at in range(1, 200, 7):
                writer.append_touch(run.id, _rows(run.touch, at, at + 7))
                if at % 3 == 0:
                    writer.flush()
            for at in range(1, 12):
                writer.append_laser(run.id, _edges(run.laser, at, at + 1))
            assert run.display is not None
            writer.append_display(run.id, run.display)
            writer.append_clock(run.sync[0], run.id)
            for entry in run.log:
                writer.append_log(entry, run.id)
            writer.end_run(run.id, "complete", duration_s=run.duration_s)
        for bounds in whole.clocks:
            writer.append_clock(bounds)
        for entry in whole.notes:
            writer.append_log(entry)
        assert whole.taps is not None
        writer.append_taps(whole.taps)
    assert_same(read_session(tmp_path / "live.h5"), whole)
    assert not (tmp_path / "live.h5.partial").exists()


def _rows(trace: TouchTrace, start: int, end: int) -> TouchTrace:
    """Rows of a trace; counters and gaps go with the first batch."""
    cut = slice(start, end)
    names = ("t_s", "x_mm", "y_mm", "contact_id", "x_raw", "y_raw", "device_t_s")
    part = replace(trace, **{name: getattr(trace, name)[cut] for name in names})
    return part if start == 0 else replace(part, dropped=0, gaps_s=np.empty((0, 2)), axes=())


def _edges(trace: LaserTrace, start: int, end: int) -> LaserTrace:
    cut = slice(start, end)
    part = replace(trace, **{name: getattr(trace, name)[cut] for name in ("t_s", "light", "device_t_s", "epoch")})
    return part if start == 0 else replace(part, missed=0)


def test_a_column_that_comes_late_or_stops_keeps_its_rows_with_their_times(tmp_path: Path) -> None:
    plain = TouchTrace(np.array([1.0, 2.0]), np.zeros(2), np.zeros(2))
    stamped = TouchTrace(np.array([3.0]), np.ones(1), np.ones(1), device_t_s=np.array([30.0]))
    with SessionWriter(tmp_path / "s.h5", bare_session()) as writer:
        writer.begin_run(Run("r", "free", 0.0, 5.0, plain, empty_laser()))
        writer.append_touch("r", stamped)
        writer.append_touch("r", replace(plain, t_s=plain.t_s + 3))
        writer.flush()
        writer.append_touch("r", replace(plain, t_s=plain.t_s + 5))
    trace = read_session(tmp_path / "s.h5").runs[0].touch
    np.testing.assert_array_equal(trace.t_s, [1, 2, 3, 4, 5, 6, 7])
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(trace.device_t_s)), [2])
    assert len(trace.contact_id) == 0


def test_clock_streams_whose_names_look_alike_stay_apart(tmp_path: Path) -> None:
    clocks = tuple(ClockBounds(name, np.ones(1) * k, np.zeros(1), np.ones(1)) for k, name in enumerate(("a/b", "a b")))
    write_session(replace(bare_session(), clocks=clocks), tmp_path / "s.h5")
    assert {c.stream: c.device_s[0] for c in read_session(tmp_path / "s.h5").clocks} == {"a/b": 0.0, "a b": 1.0}


def test_only_plain_types_with_units_and_scales_are_in_the_file(tmp_path: Path) -> None:
    write_session(full_session(), tmp_path / "s.h5")
    add_analysis(tmp_path / "s.h5", {"runs": [{"id": "run-01", "latency_ms": 100.0, "flags": ["a"]}]}, {})
    seen = []

    def look(name: str, item: h5py.HLObject) -> None:
        for key in item.attrs:
            text = h5py.check_string_dtype(item.attrs.get_id(key).dtype)
            assert text is None or text.length is not None, f"{name}@{key} has variable length"
        if isinstance(item, h5py.Dataset):
            seen.append(name)
            assert item.dtype.kind in "fiS", name
            assert item.attrs["units"], name
            assert item.ndim == 0 or item.is_scale or len(item.dims[0]) == 1, name

    with h5py.File(tmp_path / "s.h5") as file:
        file.visititems(look)
        time = file["runs/run-01/touch/time"]
        # Zero of the host's clock, as NeXus wants it: five seconds before the session started.
        assert time.attrs["start"].decode() == "2026-03-01T09:59:55+00:00"
    assert {"runs/run-01/touch/x_raw", "runs/run-02/laser/device_s", "analysis/1/runs/latency_ms"} <= set(seen)


def test_xarray_reads_the_file_without_draglag(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    pytest.importorskip("h5netcdf", reason="h5netcdf is not installed")
    session = full_session()
    write_session(session, tmp_path / "s.h5")
    add_analysis(tmp_path / "s.h5", {"runs": [{"id": "run-01", "latency_ms": 100.0}]}, {})
    with xarray.open_datatree(tmp_path / "s.h5", engine="h5netcdf") as tree:
        x_mm = tree["runs/run-01/touch/x_mm"]
        assert x_mm.dims == ("time",)
        assert x_mm.attrs["units"] == "mm"
        np.testing.assert_array_equal(x_mm.values, session.runs[0].touch.x_mm)
        np.testing.assert_array_equal(x_mm["time"].values, session.runs[0].touch.t_s)
        assert tree.attrs["schema"] == "draglag-session"


def test_h5dump_reads_the_file(tmp_path: Path) -> None:
    write_session(full_session(), tmp_path / "s.h5")
    try:
        out = subprocess.run(
            ["h5dump", "-d", "/runs/run-01/laser/light", tmp_path / "s.h5"], capture_output=True, text=True
        )
    except FileNotFoundError:
        pytest.skip("h5dump is not installed")
    assert out.returncode == 0
    assert "0, 1, 0, 1" in out.stdout


def test_results_are_kept_next_to_unchanged_raw_data(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    session = full_session()
    write_session(session, path)
    result = {"session": "x", "runs": [{"id": "r", "latency_ms": np.float64(1.5), "speed_mm_s": float("nan")}]}
    assert add_analysis(path, result, {"estimator": "paper"}, "2026-03-01T11:00:00Z") == 1
    assert add_analysis(path, result, {"estimator": "efficient"}) == 2
    assert_same(read_session(path), session)
    first, second = read_analyses(path)
    assert (first.options["estimator"], second.options["estimator"]) == ("paper", "efficient")
    assert first.result["runs"] == [{"id": "r", "latency_ms": 1.5, "speed_mm_s": None}]
    assert first.up_to_date
    assert first.software.startswith("draglag ")
    assert first.created_utc == "2026-03-01T11:00:00Z"
    with h5py.File(path) as file:
        assert file["analysis/1/runs/latency_ms"].attrs["units"] == b"ms"


def test_a_result_is_stored_only_with_the_raw_data_that_were_analysed(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    write_session(full_session(), path)
    _, analysed = read_with_state(path)
    assert add_analysis(path, {"runs": []}, {"estimator": "paper"}, analysed=analysed) == 1
    # The file is another one now, with the same raw data.
    assert add_analysis(path, {"runs": []}, {"estimator": "efficient"}, analysed=analysed) == 2
    assert [stored.up_to_date for stored in read_analyses(path)] == [True, True]
    with h5py.File(path, "r+") as file:
        file["runs/run-01/touch/x_mm"][3] += 1
    with pytest.raises(
        DataError, match=r"s\.h5: has other raw data now than were analysed\. Open and analyse it again"
    ):
        add_analysis(path, {"runs": []}, {"estimator": "efficient"}, analysed=analysed)
    path.unlink()
    with pytest.raises(DataError, match="there is no such file"):
        add_analysis(path, {"runs": []}, {}, analysed=analysed)


def test_results_that_do_not_fit_on_the_disk_leave_the_file_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_session(full_session(), tmp_path / "s.h5")
    before = (tmp_path / "s.h5").read_bytes()

    def full(fd: int, at: int, size: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(DataError, match="No space left on device"):
        add_analysis(tmp_path / "s.h5", {"runs": []}, {})
    assert (tmp_path / "s.h5").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["s.h5"]


def test_results_of_a_recording_that_was_not_closed_are_refused_with_what_to_do(tmp_path: Path) -> None:
    SessionWriter(tmp_path / "s.h5", full_session()).abandon()
    with pytest.raises(DataError, match=r"not closed. Save it first with `draglag verify .*s.h5.partial`"):
        add_analysis(tmp_path / "s.h5.partial", {"runs": []}, {})


def test_raw_data_changed_afterwards_are_noticed(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    write_session(full_session(), path)
    add_analysis(path, {"runs": []}, {})
    assert not [finding for finding in verify(path) if finding.level == "error"]
    with h5py.File(path, "r+") as file:
        file["runs/run-01/touch/x_mm"][3] += 1
    texts = [str(finding) for finding in verify(path)]
    assert any("raw data were changed" in text for text in texts)
    assert not read_analyses(path)[0].up_to_date


def test_a_sound_file_has_nothing_to_report(tmp_path: Path) -> None:
    run = full_run("run-01", 10.0)
    run = replace(
        run, touch=replace(touch(200, 10.0), dropped=0, gaps_s=np.empty((0, 2))), laser=replace(run.laser, missed=0)
    )
    write_session(bare_session(run), tmp_path / "s.h5")
    assert verify(tmp_path / "s.h5") == []


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "s.h5").write_text("precious")
    with pytest.raises(DataError, match="not overwritten"):
        write_session(full_session(), tmp_path / "s.h5")
    (tmp_path / "t.h5.partial").write_text("precious")
    with pytest.raises(DataError, match="draglag verify"):
        SessionWriter(tmp_path / "t.h5", bare_session())
    assert (tmp_path / "s.h5").read_text() == (tmp_path / "t.h5.partial").read_text() == "precious"


def test_a_name_taken_while_recording_costs_no_data(tmp_path: Path) -> None:
    writer = SessionWriter(tmp_path / "s.h5", full_session())
    (tmp_path / "s.h5").write_text("precious")
    with pytest.raises(DataError, match="exists already"):
        writer.close()
    assert (tmp_path / "s.h5").read_text() == "precious"
    assert len(read_session(tmp_path / "s.h5.partial").runs) == 2


@pytest.mark.parametrize("run_id", ["../x", "a/b", "", ".", "..", " x", "x\n"])
def test_a_run_id_that_could_leave_its_folder_is_refused(tmp_path: Path, run_id: str) -> None:
    with pytest.raises(DataError, match="cannot be the id"):
        write_session(bare_session(full_run(run_id, 0.0)), tmp_path / "s.h5")
    assert list(tmp_path.iterdir()) == []


def test_two_runs_of_one_id_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="two runs"):
        write_session(replace(bare_session(), runs=(full_run("r", 0.0), full_run("r", 5.0))), tmp_path / "s.h5")


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such folder"):
        write_session(full_session(), tmp_path / "none" / "s.h5")


def test_migration_keeps_raw_data_and_results(tmp_path: Path) -> None:
    write_session(full_session(), tmp_path / "old.h5")
    add_analysis(tmp_path / "old.h5", {"runs": []}, {"a": 1})
    migrate(tmp_path / "old.h5", tmp_path / "new.h5")
    assert_same(read_session(tmp_path / "new.h5"), full_session())
    assert read_analyses(tmp_path / "new.h5")[0].options["a"] == 1


def test_long_log_texts_are_cut_between_characters(tmp_path: Path) -> None:
    text = "µ" * 1000 + "€" * 1000
    write_session(replace(bare_session(), notes=(LogEntry(0.0, "note", "o", text),)), tmp_path / "s.h5")
    assert read_session(tmp_path / "s.h5").notes[0].text == text
    with h5py.File(tmp_path / "s.h5") as file:
        assert "".join(part.decode() for part in file["notes/text"][()]) == text


def test_files_of_version_1_are_read_and_take_results(tmp_path: Path) -> None:
    path = tmp_path / "old.h5"
    path.write_bytes(gzip.decompress((DATA / "session-v1.h5.gz").read_bytes()))
    session = read_session(path)
    assert session.name == "Prüfling A"
    assert [note.text for note in session.notes] == ["Schirm gereinigt"]
    assert session.runs[0].log[0].text == "Zeit läuft rückwärts " * 40
    assert session.seed == 7
    assert [finding for finding in verify(path) if finding.level == "error"] == []
    stored = read_analyses(path)[0]
    assert stored.result["session"] == "Prüfling A"
    assert add_analysis(path, stored.result, {}) == 2
    assert_same(read_session(path), session)
    assert read_analyses(path)[1].up_to_date
    migrate(path, tmp_path / "new.h5")
    assert_same(read_session(tmp_path / "new.h5"), session)
    with h5py.File(tmp_path / "new.h5") as file:
        assert file.attrs["schema_version"] == 2


def test_texts_are_of_the_type_that_octave_loads_and_keep_every_letter(tmp_path: Path) -> None:
    write_session(full_session(), tmp_path / "s.h5")
    add_analysis(tmp_path / "s.h5", {"session": "Prüfling", "runs": [{"id": "Läufer"}]}, {})
    texts = {}

    def look(name: str, item: h5py.HLObject) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind == "S":
            kind = item.id.get_type()
            assert kind.get_cset() == h5py.h5t.CSET_ASCII, name
            assert item.attrs["_Encoding"] == b"utf-8", name
            texts[name] = item[()]

    with h5py.File(tmp_path / "s.h5") as file:
        file.visititems(look)
    assert b"".join(texts["runs/run-01/log/text"][:-1]).decode() == "Zeit läuft rückwärts " * 40
    assert texts["protocol_toml"].decode() == full_session().protocol_toml
    assert texts["analysis/1/runs/id"][0].decode() == "Läufer"


def test_viewers_of_nexus_find_touch_and_then_the_result_to_draw(tmp_path: Path) -> None:
    nxdata = pytest.importorskip("silx.io.nxdata", reason="silx is not installed")
    path = tmp_path / "s.h5"
    write_session(full_session(), path)
    with h5py.File(path) as file:
        plot = nxdata.get_default(file)
        assert (plot.group.name, plot.signal_dataset_name, plot.axes_dataset_names) == (
            "/runs/run-01/touch", "y_mm", ["time"],
        )  # fmt: skip
        assert all(nxdata.NXdata(file[f"runs/run-02/{stream}"]).is_valid for stream in ("touch", "laser", "display"))
    before = verify(path)
    rows = [
        {"id": "run-01", "speed_mm_s": 90.0, "latency_ms": 70.0, "latency_ci95_ms": [68.0, 72.0]},
        {"id": "run-02", "speed_mm_s": 50.0, "latency_ms": 90.0, "latency_ci95_ms": [87.0, 93.0]},
        {"id": "run-03", "speed_mm_s": 40.0, "latency_ms": None, "latency_ci95_ms": None},
    ]
    add_analysis(path, {"runs": rows}, {})
    assert verify(path) == before  # what viewers draw is no part of the raw data
    with h5py.File(path) as file:
        plot = nxdata.get_default(file)
        assert plot.is_curve
        np.testing.assert_array_equal(plot.axes[0][()], [50.0, 90.0])
        np.testing.assert_array_equal(plot.signal[()], [90.0, 70.0])
        np.testing.assert_array_equal(plot.errors[()], [3.0, 2.0])
