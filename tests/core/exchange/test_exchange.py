"""The neutral exchange folder and the plain formats."""

from __future__ import annotations

import csv
import gzip
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import loadmat

from core.store_sessions import assert_same, bare_session, full_session
from draglag.analysis import analyze
from draglag.errors import DataError
from draglag.exchange import read_exchange, write_csv, write_exchange, write_mat, write_netcdf
from draglag.exchange.tables import read_events
from draglag.protocol.runs import load_protocol
from draglag.reading.limits import HEADER_BYTES
from draglag.recording import LaserTrace, Run, TouchTrace, empty_laser, empty_touch
from draglag.simulation import simulate_session
from draglag.store import add_analysis, write_session
from draglag_app.cli.files import export

SAMPLES = Path(__file__).parents[2] / "data" / "exchange"


@pytest.mark.parametrize("name", ["none-A", "low_speed_plateau"])
def test_a_sample_folder_is_imported_whole_and_without_complaint(name: str) -> None:
    session = read_exchange(SAMPLES / name)
    assert len(session.runs) == 15
    assert session.taps is not None
    assert session.taps.down.sum() == 100
    assert session.notes == ()
    for run in session.runs:
        # Absolute host times: the run's samples lie between its start and its end.
        assert run.touch.t_s[0] >= run.start_s
        assert run.touch.t_s[-1] <= run.start_s + run.duration_s + 0.5
        assert set(np.diff(run.laser.light)) == {-1, 1}


@pytest.mark.parametrize("compress", [True, False])
def test_what_is_written_comes_back(tmp_path: Path, compress: bool) -> None:
    session = read_exchange(SAMPLES / "none-A")
    write_exchange(session, tmp_path / "out", compress)
    assert_same(read_exchange(tmp_path / "out"), session)


@pytest.mark.parametrize("compress", [True, False])
def test_a_session_from_the_rig_comes_back_whole(tmp_path: Path, compress: bool) -> None:
    session = full_session()
    write_exchange(session, tmp_path / "out", compress)
    assert_same(read_exchange(tmp_path / "out"), session)


def test_rows_recorded_twice_and_lost_edges_come_back_as_they_were(tmp_path: Path) -> None:
    run = full_session().runs[0]
    twice = np.repeat(np.arange(3), 2)
    touch = TouchTrace(10.0 + twice, 1.0 + twice, 2.0 + twice)
    run = replace(run, touch=touch, laser=LaserTrace(np.array([10.0, 11.0]), np.array([1, 1]), missed=5), log=())
    write_exchange(bare_session(run), tmp_path / "out")
    assert_same(read_exchange(tmp_path / "out"), bare_session(run))


def test_a_reader_of_the_mandatory_parts_still_reads_the_folder(tmp_path: Path) -> None:
    session = full_session()
    write_exchange(session, tmp_path / "out", compress=False)
    header = json.loads((tmp_path / "out" / "session.json").read_text("utf-8"))
    assert (header["format"], header["version"]) == ("draglag-exchange", 1)
    assert (tmp_path / "out" / "run-01.touch.csv").read_text().startswith("t_s,x_mm,y_mm\n")
    assert (tmp_path / "out" / "run-01.laser.csv").read_text().startswith("t_s,light\n")


def test_latencies_intervals_flags_and_outcomes_survive_a_round_trip(tmp_path: Path) -> None:
    sweep = load_protocol("latency-sweep")
    circles = [run.model_copy(update={"duration_s": 25.0}) for run in sweep.runs][-1:]
    step = next(run for run in load_protocol("validation-x3").runs if run.kind == "step").model_copy(
        update={"repeats": 1}
    )
    session = simulate_session("screen-1", sweep.model_copy(update={"runs": (*circles, step)}), seed=1)
    assert all(run.sync for run in session.runs)
    session = replace(session, runs=(*session.runs[:2], replace(session.runs[2], outcome="aborted"), *session.runs[3:]))
    write_exchange(session, tmp_path / "out")
    back = read_exchange(tmp_path / "out")
    before, after = analyze(session), analyze(back)
    assert before.to_dict() == after.to_dict()
    assert [run.outcome for run in back.runs] == [run.outcome for run in session.runs]
    # The clock comparisons are in the intervals: without them these would be narrower.
    without = analyze(replace(session, clocks=(), runs=tuple(replace(run, sync=()) for run in session.runs)))
    for run, narrow in zip(before.runs, without.runs, strict=True):
        assert np.diff(run.latency_ci95_s or (0, 0)) > np.diff(narrow.latency_ci95_s or (0, 0))


def test_a_folder_that_calls_itself_simulated_stays_recognisable(tmp_path: Path) -> None:
    assert "simulated" in read_exchange(folder_of(tmp_path, simulated=True)).devices
    assert "simulated" not in read_exchange(folder_of(tmp_path)).devices


def test_a_note_of_one_text_is_kept(tmp_path: Path) -> None:
    assert [note.text for note in read_exchange(folder_of(tmp_path, notes="cleaned")).notes] == ["cleaned"]


RUN = {"id": "r1", "protocol": "circle", "duration_s": 1.0, "start_s": 10.0}
CLOCK = [{"stream": "laser", "file": "c"}]
TOUCHED = {"x_raw": [], "y_raw": [], "x_mm": [], "y_mm": [], "matrix": [[1, 0, 0], [0, 1, 0]]}
BAD_OPTIONAL: list[tuple[dict[str, Any], dict[str, bytes], str]] = [
    ({}, {"r1.touch-more.csv": b"t_s,x_raw\n10.0,1\n"}, r"touch-more\.csv: its rows are not those of r1\.touch\.csv"),
    ({}, {"r1.touch-more.csv": b"t_s,x_raw\n10.0,1\n10.1,2\n10.3,3\n"}, r"its rows are not those"),
    ({}, {"r1.touch-more.csv": b"t_s,contact_id\n10.0,1\n10.1,2.5\n10.2,3\n"}, "whole numbers for contact_id"),
    ({}, {"r1.laser-more.csv": b"t_s,epoch\n10.05,nan\n10.15,1\n"}, "whole numbers for epoch"),
    ({}, {"r1.laser-more.csv": b"t_s,epoch\n10.05,1e300\n10.15,1\n"}, "whole numbers for epoch"),
    ({}, {"r1.display.csv": b"\xff\xfe"}, r"r1\.display\.csv, line 1: is not UTF-8 text"),
    ({}, {"r1.touch-gaps.csv": b"start_s\n1\n"}, r"touch-gaps\.csv, line 1: expected the header start_s,end_s"),
    ({}, {"r1.touch-gaps.csv.gz": b"none"}, "is not sound gzip"),
    ({"clocks": [{"stream": "laser", "file": "c.csv"}]}, {}, r"c\.csv: cannot be read"),
    ({"clocks": [{"stream": "laser", "file": "../c.csv"}]}, {}, "expected the name of a file in the same folder"),
    ({"clocks": [{"stream": "laser", "file": ".."}]}, {}, "is a folder"),
    ({"clocks": CLOCK}, {"c": b"device_s,host_min_s,host_max_s\n1,3,2\n"}, "no later than"),
    ({"clocks": CLOCK}, {"c": b"device_s,host_min_s,host_max_s\nnan,1,2\n"}, "finite device_s"),
    ({"protocol_file": "p.toml"}, {}, r"p\.toml: cannot be read"),
    ({"protocol_file": "p.toml"}, {"p.toml": b"\xff"}, "is not UTF-8 text"),
    ({"calibration": {**TOUCHED, "x_raw": [1]}}, {}, "of one length"),
    ({"calibration": {**TOUCHED, "matrix": [[1]]}}, {}, "calibration.matrix"),
    ({"seed": "7"}, {}, "seed: expected"),
    ({"simulated": "no"}, {}, "simulated: expected"),
    ({"runs": [{**RUN, "touch_dropped": -1}]}, {}, "touch_dropped: expected"),
    ({"runs": [{**RUN, "touch_axes": [{"name": "x"}]}]}, {}, "minimum: is missing"),
    ({"runs": [{**RUN, "touch_axes": [{"name": "x", "minimum": 0, "maximum": 2**64}]}]}, {}, "maximum: expected"),
]  # fmt: skip


@pytest.mark.parametrize(("keys", "files", "message"), BAD_OPTIONAL)
def test_a_malformed_optional_part_is_one_sentence(
    tmp_path: Path, keys: dict[str, Any], files: dict[str, bytes], message: str
) -> None:
    folder = folder_of(tmp_path, **keys)
    for name, data in files.items():
        (folder / name).write_bytes(data)
    with pytest.raises(DataError, match=message) as caught:
        read_exchange(folder)
    assert "\n" not in str(caught.value)


def test_a_protocol_longer_than_the_limit_is_refused(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, protocol_file="p.toml")
    with (folder / "p.toml").open("wb") as file:
        file.truncate(HEADER_BYTES + 1)
    with pytest.raises(DataError, match="longer than 16 MiB"):
        read_exchange(folder)


@pytest.mark.parametrize(("kind", "dropped"), [("exchange", False), ("mat", False), ("csv", True)])
def test_the_export_command_names_what_it_leaves_out(tmp_path: Path, kind: str, dropped: bool) -> None:
    write_session(full_session(), tmp_path / "s.h5")
    add_analysis(tmp_path / "s.h5", {"runs": []}, {})
    done = CliRunner().invoke(export, [str(tmp_path / "s.h5"), "--to", kind, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0
    assert "results of 1 analyses" in done.output
    assert ("clock comparisons, device clock of the laser" in done.output) is dropped


def test_names_that_read_the_same_in_matlab_keep_their_data(tmp_path: Path) -> None:
    first, second = full_session().runs
    streams = tuple(replace(first.sync[0], stream=name) for name in ("laser 1", "laser/1"))
    write_mat(bare_session(replace(first, sync=streams)), tmp_path / "streams.mat")
    session = replace(full_session(), runs=(first, replace(second, id="run_01")))
    write_mat(session, tmp_path / "runs.mat")
    found = loadmat(tmp_path / "runs.mat", squeeze_me=True, simplify_cells=True)["session"]["runs"]
    assert {name: run["id"] for name, run in found.items()} == {"run_01": "run-01", "run_01_2": "run_01"}
    sync = loadmat(tmp_path / "streams.mat", squeeze_me=True, simplify_cells=True)["session"]["runs"]["run_01"]["sync"]
    assert sorted(one["stream"] for one in sync.values()) == ["laser 1", "laser/1"]


TOUCH = "t_s,x_mm,y_mm\n10.0,1,2\n10.1,3,4\n10.2,5,6\n"
LASER = "t_s,light\n10.05,0\n10.15,1\n"


def folder_of(path: Path, touch: str | bytes | None = TOUCH, laser: str | None = LASER, **changes: Any) -> Path:
    run = {"id": "r1", "protocol": "circle", "nominal_speed_mm_s": 44.0, "radius_mm": 50.0, "duration_s": 1.0}
    header: dict[str, Any] = {
        "format": "draglag-exchange",
        "version": 1,
        "screen": {"name": "s", "width_mm": 500.0, "height_mm": 300.0, "width_px": 1920, "height_px": 1080},
        "stylus_diameter_mm": 7.0,
        "clock": "host",
        "runs": [{**run, "start_s": 10.0}],
        "taps": None,
    }
    path.mkdir(exist_ok=True)
    (path / "session.json").write_text(json.dumps({**header, **changes}))
    for name, text in (("touch", touch), ("laser", laser)):
        if text is not None:
            (path / f"r1.{name}.csv").write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def said(path: Path) -> str:
    return " | ".join(note.text for note in read_exchange(path).notes)


def test_rows_without_numbers_are_left_out_and_said(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, touch="t_s,x_mm,y_mm\n10.0,1,2\n10.1,nan,4\n10.2,5,inf\n10.3,7,8\n")
    np.testing.assert_array_equal(read_exchange(folder).runs[0].touch.x_mm, [1, 7])
    assert "2 rows hold no number and are left out, the first in line 3" in said(folder)


def test_times_are_put_in_order_and_repeated_rows_merged_and_said(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, touch="t_s,x_mm,y_mm\n10.2,5,6\n10.0,1,2\n10.0,1,2\n")
    trace = read_exchange(folder).runs[0].touch
    np.testing.assert_array_equal(trace.t_s, [10.0, 10.2])
    np.testing.assert_array_equal(trace.x_mm, [1, 5])
    assert "go back 1 times" in said(folder)
    assert "1 rows come twice" in said(folder)


def test_frames_delivered_together_are_all_kept(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, touch="t_s,x_mm,y_mm\n10.0,1,2\n10.0,3,4\n10.2,5,6\n10.2,7,8\n")
    trace = read_exchange(folder).runs[0].touch
    np.testing.assert_array_equal(trace.t_s, [10.0, 10.0, 10.2, 10.2])
    np.testing.assert_array_equal(trace.x_mm, [1, 3, 5, 7])


def test_a_level_twice_running_counts_as_a_missing_edge(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, laser="t_s,light\n10.1,0\n10.1,0\n10.2,1\n10.3,1\n10.4,0\n")
    laser = read_exchange(folder).runs[0].laser
    np.testing.assert_array_equal(laser.light, [0, 1, 1, 0])
    assert laser.missed == 1
    assert "1 edges are missing" in said(folder)
    assert "1 edges come twice" in said(folder)


@pytest.mark.parametrize("laser", [None, "", "t_s,light\n"])
def test_a_run_without_edges_is_imported_and_said(tmp_path: Path, laser: str | None) -> None:
    folder = folder_of(tmp_path, laser=laser)
    run = read_exchange(folder).runs[0]
    assert (len(run.touch.t_s), len(run.laser.t_s)) == (3, 0)
    assert "laser" in said(folder)


def test_line_ends_byte_order_marks_blank_lines_and_further_columns_do_no_harm(tmp_path: Path) -> None:
    text = "\ufeffpressure,t_s,x_mm,y_mm\r\n1,10.0,1,2\r\n\r\n1,10.1, 3 ,4\r\n"
    trace = read_exchange(folder_of(tmp_path, touch=text)).runs[0].touch
    np.testing.assert_array_equal(trace.x_mm, [1, 3])


def test_times_relative_to_the_run_are_pointed_out(tmp_path: Path) -> None:
    header = {"id": "r1", "protocol": "circle", "duration_s": 1.0, "start_s": 500.0}
    assert "must be on one host clock" in said(folder_of(tmp_path, runs=[header]))


def test_a_run_without_a_start_spans_its_samples(tmp_path: Path) -> None:
    run = read_exchange(folder_of(tmp_path, runs=[{"id": "r1", "protocol": "free"}])).runs[0]
    assert run.start_s == 10.0
    assert run.duration_s == pytest.approx(0.2)


BAD: list[tuple[dict[str, Any], str]] = [
    (
        {"touch": "t_s,x_mm,y_mm\n10.0,1,2\n10.1,abc,4\n"},
        r"r1\.touch\.csv, line 3: expected a number for x_mm, found “abc”",
    ),
    ({"touch": "t_s,x_mm,y_mm\n10.0,1,2\n\n10.1,3\n"}, r"r1\.touch\.csv, line 4: expected 3 cells"),
    ({"touch": "t_s,x_mm,y_mm\n10.0,1,2,9\n10.1,3,4,9\n"}, r"r1\.touch\.csv, line 2: expected 3 cells"),
    ({"touch": "time,x,y\n1,2,3\n"}, r"r1\.touch\.csv, line 1: expected the header t_s,x_mm,y_mm"),
    ({"touch": "1,2,3\n4,5,6\n"}, r"r1\.touch\.csv, line 1: expected the header"),
    ({"touch": b"t_s,x_mm,y_mm\n1,2,3\n\xff\xfe,1,1\n"}, r"r1\.touch\.csv, line 3: is not UTF-8 text"),
    ({"laser": "t_s,light\n10.0,1\n10.1,2\n"}, r"r1\.laser\.csv, line 3: expected light 0 or 1, found 2"),
    ({"touch": None, "laser": None}, "holds no data of any run"),
    ({"touch": "", "laser": ""}, "holds no data of any run"),
    ({"stylus_diameter_mm": "7 mm"}, r"session\.json: stylus_diameter_mm: expected .*number.*not \"7 mm\""),
    ({"stylus_diameter_mm": -7}, r"session\.json: stylus_diameter_mm: expected .*greater than 0"),
    ({"screen": {"name": "s"}}, r"session\.json: screen.width_mm: is missing"),
    ({"version": 2}, "newer draglag"),
    ({"format": "other"}, r"session\.json: format: expected 'draglag-exchange'"),
    ({"runs": [{"id": "r1", "protocol": "spiral"}]}, r"runs\[0\]\.protocol: expected one of 'circle', 'chirp'"),
    ({"runs": [{"id": "../../etc/passwd", "protocol": "circle"}]}, "cannot be the id of a run"),
    ({"runs": [{"id": "r1", "protocol": "circle"}, {"id": "r1", "protocol": "chirp"}]}, "two runs “r1”"),
    ({"taps": "../taps.csv"}, r"taps: expected the name of a file in the same folder"),
    ({"taps": "taps.csv"}, r"taps\.csv: there is no such file"),
    ({"stylus_diameter_mm": float("nan")}, "stylus_diameter_mm: expected a finite number"),
    ({"stylus_diameter_mm": True}, "stylus_diameter_mm: expected a number, not true"),
    ({"stylus_diameter_mm": "7"}, 'stylus_diameter_mm: expected a number, not "7"'),
    ({"screen": None}, r"screen: expected an object \{…\}, not null"),
    ({"runs": "x"}, r"runs: expected a list \[…\], not \"x\""),
]


@pytest.mark.parametrize(("changes", "message"), BAD)
def test_malformed_input_gets_one_sentence_with_the_place(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(DataError, match=message) as caught:
        read_exchange(folder_of(tmp_path, **changes))
    assert "\n" not in str(caught.value)


def test_broken_json_is_located(tmp_path: Path) -> None:
    (tmp_path / "session.json").write_text('{\n "format": "draglag-exchange",\n oops\n}')
    with pytest.raises(DataError, match=r"session\.json, line 3, column 2: is not JSON"):
        read_exchange(tmp_path)


def test_a_number_too_long_to_read_is_refused(tmp_path: Path) -> None:
    (tmp_path / "session.json").write_text('{"version": ' + "9" * 6000 + "}")
    with pytest.raises(DataError, match=r"session\.json: holds a number that is too long"):
        read_exchange(tmp_path)


def test_events_from_elsewhere_are_read_and_lines_that_cannot_be_distinguished_named(tmp_path: Path) -> None:
    path = tmp_path / "touch.csv"
    path.write_text('"id","y_mm","t_s","x_mm"\n# a note\na1,2,0.5,1\n\na2,,0.6,3\n')
    np.testing.assert_array_equal(read_events(path, ("t_s", "x_mm", "y_mm")), [[0.5, 1, 2], [0.6, 3, np.nan]])
    path.write_text("t_s,x_mm,y_mm\n0,1,2\n0.1,9,1,2\n")
    with pytest.raises(DataError, match=r"touch\.csv, line 3: expected 3 cells"):
        read_events(path, ("t_s", "x_mm", "y_mm"))


def test_a_folder_that_takes_no_netcdf_is_one_short_reason() -> None:
    pytest.importorskip("h5netcdf")
    with pytest.raises(DataError, match="there is no such folder"):
        write_netcdf(full_session(), Path("/nowhere/at/all/s.nc"))


def test_folders_that_are_none_are_called_so(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such folder"):
        read_exchange(tmp_path / "none")
    with pytest.raises(DataError, match=r"holds no session\.json"):
        read_exchange(tmp_path)


@pytest.mark.parametrize("data", [b"not gzip", gzip.compress(TOUCH.encode())[:-12]])
def test_broken_gzip_is_called_so(tmp_path: Path, data: bytes) -> None:
    folder_of(tmp_path, touch=None)
    (tmp_path / "r1.touch.csv.gz").write_bytes(data)
    with pytest.raises(DataError, match=r"r1\.touch\.csv\.gz: is not sound gzip"):
        read_exchange(tmp_path)


@pytest.mark.parametrize("write", [write_exchange, write_csv, write_mat, write_netcdf])
def test_nothing_is_overwritten(tmp_path: Path, write: Callable[[Any, Path], Path]) -> None:
    if write is write_netcdf:
        pytest.importorskip("h5netcdf", reason="h5netcdf is not installed")
    (tmp_path / "out").write_text("precious")
    with pytest.raises(DataError, match="not overwritten"):
        write(full_session(), tmp_path / "out")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "mine").write_text("precious")
    with pytest.raises(DataError, match="not overwritten"):
        write(full_session(), tmp_path / "folder")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "out"]


def test_an_export_that_fails_leaves_nothing_behind(tmp_path: Path) -> None:
    bad = replace(full_session().runs[0], id="a/b")
    with pytest.raises(DataError, match="cannot be the id"):
        write_exchange(bare_session(bad), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_tidy_csv_has_one_row_a_record(tmp_path: Path) -> None:
    session = full_session()
    write_csv(session, tmp_path / "out")
    tables = {path.name: list(csv.DictReader(path.open(encoding="utf-8"))) for path in (tmp_path / "out").iterdir()}
    assert len(tables["touch.csv"]) == 400
    assert len(tables["edges.csv"]) == 24
    assert len(tables["taps.csv"]) == 4
    runs = {row["id"]: row for row in tables["runs.csv"]}
    assert (runs["run-01"]["nominal_speed_mm_s"], runs["run-02"]["nominal_speed_mm_s"]) == ("123.4", "")
    assert float(tables["touch.csv"][200]["x_mm"]) == session.runs[1].touch.x_mm[0]
    assert tables["touch.csv"][200]["run"] == "run-02"


def test_matlab_gets_the_same_numbers_under_names_it_allows(tmp_path: Path) -> None:
    session = full_session()
    write_mat(session, tmp_path / "s.mat")
    loaded = loadmat(tmp_path / "s.mat", squeeze_me=True, simplify_cells=True)["session"]
    np.testing.assert_array_equal(loaded["runs"]["run_01"]["touch"]["x_mm"], session.runs[0].touch.x_mm)
    assert loaded["runs"]["run_01"]["id"] == "run-01"
    assert loaded["screen"]["width_mm"] == 509.2


def test_netcdf_gets_the_same_numbers_on_a_time_axis(tmp_path: Path) -> None:
    pytest.importorskip("h5netcdf", reason="h5netcdf is not installed")
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    session = replace(
        full_session(), runs=(*full_session().runs, Run("e", "free", 50.0, 1.0, empty_touch(), empty_laser()))
    )
    write_netcdf(session, tmp_path / "s.nc")
    with xarray.open_datatree(tmp_path / "s.nc", engine="h5netcdf") as tree:
        y_mm = tree["runs/run-02/touch/y_mm"]
        np.testing.assert_array_equal(y_mm.values, session.runs[1].touch.y_mm)
        np.testing.assert_array_equal(y_mm["time"].values, session.runs[1].touch.t_s)
        assert y_mm.attrs["units"] == "mm"


def test_netcdf_without_its_package_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5netcdf", None)
    with pytest.raises(DataError, match=r"h5netcdf.*pip install \"draglag\[netcdf\]\""):
        write_netcdf(full_session(), tmp_path / "s.nc")
