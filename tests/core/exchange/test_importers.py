"""Recordings of other programs become sessions that give the same latency as the run they were made from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from core.xdf_files import xdf
from draglag.analysis import analyze
from draglag.errors import DataError
from draglag.exchange import read_exchange
from draglag.exchange.importers import HowToRead, format_of, parse_map, read_recordings
from draglag.exchange.importers.evtest import parse_evtest
from draglag.exchange.importers.libinput import parse_libinput
from draglag.recording import LaserTrace, Run, Screen, Session, TouchTrace
from draglag.store import read_session
from draglag_app.cli.main import cli

SAMPLE = Path(__file__).parents[2] / "data" / "exchange" / "none-A"
UNITS_PER_MM = 100
# On the wall clock, as evtest and WALT's tool have it.
EPOCH_S = 1.7e9


@pytest.fixture(scope="module")
def measured() -> Session:
    """A session of one run that has a latency."""
    session = read_exchange(SAMPLE)
    run = next(run for run in session.runs if run.protocol == "circle")
    moved = replace(run, start_s=run.start_s + EPOCH_S, touch=replace(run.touch, t_s=run.touch.t_s + EPOCH_S),
                    laser=replace(run.laser, t_s=run.laser.t_s + EPOCH_S))  # fmt: skip
    return replace(session, runs=(moved,), taps=None)


def latency_ms(session: Session) -> float:
    (run,) = analyze(session).runs
    assert run.latency_s is not None
    return 1e3 * run.latency_s


def raw(touch: TouchTrace) -> list[tuple[float, int, int]]:
    x, y = (np.rint(UNITS_PER_MM * values).astype(int) for values in (touch.x_mm, touch.y_mm))
    return list(zip(touch.t_s.tolist(), x.tolist(), y.tolist(), strict=True))


def evtest(touch: TouchTrace) -> str:
    lines = ["Input driver version is 1.0.1", 'Input device name: "A panel"', "Supported events:",
             "  Event type 3 (EV_ABS)"]  # fmt: skip
    for code, name, most in ((53, "ABS_MT_POSITION_X", 50919), (54, "ABS_MT_POSITION_Y", 28639)):
        lines += [f"    Event code {code} ({name})", "      Value      0", "      Min        0", f"      Max    {most}",
                  f"      Resolution     {UNITS_PER_MM}"]  # fmt: skip
    lines.append("Testing ... (interrupt to exit)")
    for k, (t_s, x, y) in enumerate(raw(touch)):
        at = f"Event: time {t_s:.6f}, "
        if k == 0:
            lines.append(f"{at}type 3 (EV_ABS), code 57 (ABS_MT_TRACKING_ID), value 7")
        lines += [f"{at}type 3 (EV_ABS), code 53 (ABS_MT_POSITION_X), value {x}",
                  f"{at}type 3 (EV_ABS), code 54 (ABS_MT_POSITION_Y), value {y}",
                  f"{at}type 4 (EV_MSC), code 4 (MSC_SCAN), value d00e3",
                  f"{at}-------------- SYN_REPORT ------------"]  # fmt: skip
    return "\n".join([*lines, "Event: time 17"])  # ended while it wrote


def evemu(touch: TouchTrace) -> str:
    lines = ["# EVEMU 1.3", "N: A panel", f"A: 35 0 50919 0 0 {UNITS_PER_MM}", f"A: 36 0 28639 0 0 {UNITS_PER_MM}"]
    for k, (t_s, x, y) in enumerate(raw(touch)):
        lines += [f"E: {t_s:.6f} 0003 0039 7"] if k == 0 else []
        lines += [f"E: {t_s:.6f} 0003 0035 {x}", f"E: {t_s:.6f} 0003 0036 {y}", f"E: {t_s:.6f} 0000 0000 0"]
    return "\n".join(lines) + "\n"


def libinput(touch: TouchTrace) -> str:
    lines = ["# libinput record", "version: 1", "ndevices: 2", "devices:", "- node: /dev/input/event1", "  evdev:",
             '    name: "A keyboard"', "  events:", "  - evdev:", "    - [1700000000, 5, 1, 30, 1] # EV_KEY / KEY_A",
             "- node: /dev/input/event4", "  evdev:", '    name: "A panel"', "    codes:", "      3: [53, 54, 57]",
             "    absinfo:", f"      53: [0, 50919, 0, 0, {UNITS_PER_MM}]",
             f"      54: [0, 28639, 0, 0, {UNITS_PER_MM}]", "    properties: []",
             "  events:", "  # Current time is 12:30:20"]  # fmt: skip
    for k, (t_s, x, y) in enumerate(raw(touch)):
        seconds, micro = divmod(round(1e6 * t_s), 10**6)
        rows = ([(3, 57, 7)] if k == 0 else []) + [(3, 53, x), (3, 54, y), (0, 0, 0)]
        lines += ["  - evdev:", *(f"    - [{seconds:3}, {micro:6}, {a:3}, {b:3}, {c:5}] # EV" for a, b, c in rows)]
    return "\n".join(lines) + "\n"


def laser_csv(laser: LaserTrace) -> str:
    rows = (f"{t!r},{light}" for t, light in zip(laser.t_s.tolist(), laser.light.tolist(), strict=True))
    return "\n".join(["t_s,light", *rows]) + "\n"


@pytest.mark.parametrize(("name", "write"), [("a.log", evtest), ("a.events", evemu), ("a.yml", libinput)])
def test_a_log_of_input_events_with_a_laser_file_next_to_it_gives_the_latency(
    measured: Session, tmp_path: Path, name: str, write: Callable[[TouchTrace], str]
) -> None:
    run = measured.runs[0]
    (tmp_path / name).write_text(write(run.touch), "utf-8")
    (tmp_path / "a.laser.csv").write_text(laser_csv(run.laser), "utf-8")
    session = read_recordings((tmp_path / name,))
    found = session.runs[0]
    np.testing.assert_allclose(found.touch.t_s, run.touch.t_s, atol=1e-6)
    np.testing.assert_allclose(found.touch.x_mm, run.touch.x_mm, atol=0.5001 / UNITS_PER_MM)
    assert session.screen.name == "A panel"
    assert (session.screen.width_mm, session.screen.height_mm) == (509.2, 286.4)
    assert latency_ms(session) == pytest.approx(latency_ms(measured), abs=0.05)
    cut = f"{name}: its last line is cut off and left out"
    assert (cut in [note.text for note in session.notes]) == (write is evtest)


def test_the_logs_of_walts_host_tool_are_one_run_with_a_warning_of_their_rounding(
    measured: Session, tmp_path: Path
) -> None:
    run = measured.runs[0]
    (tmp_path / "WALT_1_evtest.log").write_text(evtest(run.touch), "utf-8")
    edges = zip(run.laser.t_s, run.laser.light, strict=True)
    (tmp_path / "WALT_1_laser.log").write_text("".join(f"{t_s:.3f} {light}\n" for t_s, light in edges), "utf-8")
    session = read_recordings((tmp_path / "WALT_1_evtest.log",))
    assert any("rounded to 1 ms" in note.text for note in session.notes)
    np.testing.assert_allclose(session.runs[0].laser.t_s, run.laser.t_s, atol=0.501e-3)
    assert latency_ms(session) == pytest.approx(latency_ms(measured), abs=0.5)


def test_any_table_is_read_by_its_columns_units_and_clocks(measured: Session, tmp_path: Path) -> None:
    run, screen = measured.runs[0], measured.screen
    pixels = zip(run.touch.t_s - EPOCH_S, run.touch.x_mm / screen.mm_per_px[0], run.touch.y_mm / 25.4, strict=True)
    rows = [f"{1e3 * t:.4f};{x:.4f};{y:.5f};finger".replace(".", ",") for t, x, y in pixels]
    (tmp_path / "drag.csv").write_text("\n".join(["stamp;posX;posY;what", *rows]), "utf-8")
    # The diode is sampled at 5 kHz.
    t_s = np.arange(run.laser.t_s[0] - 0.1, run.laser.t_s[-1] + 0.1, 2e-4)
    level = run.laser.light[np.clip(np.searchsorted(run.laser.t_s, t_s, side="right") - 1, 0, None)]
    level = np.where(t_s < run.laser.t_s[0], 1 - run.laser.light[0], level)
    samples = (f"{1e6 * (t - EPOCH_S - 4):.0f}\t{0.2 + 3 * v}" for t, v in zip(t_s, level, strict=True))
    (tmp_path / "diode.txt").write_text("\n".join(["us\tvolt", *samples]), "utf-8")
    mapped = ["t=stamp:ms", "x=posX:px", "y=posY:in", "laser.t=us:us", "laser.light=volt:>1.5", "laser.clock=4"]
    how = HowToRead(laser=tmp_path / "diode.txt", map=parse_map(mapped), screen=screen)
    session = read_recordings((tmp_path / "drag.csv",), how)
    found = session.runs[0]
    np.testing.assert_allclose(found.touch.y_mm, run.touch.y_mm, atol=1e-3)
    assert np.array_equal(found.laser.light, run.laser.light)
    assert latency_ms(session) == pytest.approx(latency_ms(measured), abs=0.2)


def test_streams_of_the_lab_streaming_layer_give_the_latency(measured: Session, tmp_path: Path) -> None:
    pytest.importorskip("pyxdf", reason="pyxdf is not installed")
    run = measured.runs[0]
    touch = (["x_mm", "y_mm"], run.touch.t_s, np.column_stack([run.touch.x_mm, run.touch.y_mm]))
    laser = (["light"], run.laser.t_s, run.laser.light[:, None].astype(float))
    path = tmp_path / "a.xdf"
    path.write_bytes(xdf({"eeg": (["Cz"], run.touch.t_s[:9], np.zeros((9, 1))), "panel": touch, "diode": laser}))
    session = read_recordings((path,), HowToRead(screen=measured.screen))
    np.testing.assert_array_equal(session.runs[0].touch.t_s, run.touch.t_s)  # as stamped, not smoothed
    assert latency_ms(session) == pytest.approx(latency_ms(measured), abs=1e-6)
    with pytest.raises(DataError, match=r"no stream of touch; it has eeg \(Cz\), panel \(x_mm, y_mm\)"):
        read_recordings((path,), HowToRead(screen=measured.screen, map=parse_map(["stream=eeg"])))
    for mapped, said in (
        (["x=x_mm", "y=9"], r"no channel 9 in eeg \(Cz\), panel \(x_mm, y_mm\), diode \(light\)\. Name the stream"),
        (["stream=panel", "y=9"], r"a\.xdf: no channel 9 in panel \(x_mm, y_mm\)\. .* by number from 0"),
        (["stream=finger", "y=9"], r"no stream of touch; it has eeg"),
    ):
        with pytest.raises(DataError, match=said):
            read_recordings((path,), HowToRead(screen=measured.screen, map=parse_map(mapped)))
    by_number = HowToRead(screen=measured.screen, map=parse_map(["stream=panel", "x=0", "y=1"]))
    np.testing.assert_array_equal(read_recordings((path,), by_number).runs[0].touch.x_mm, run.touch.x_mm)
    path.write_bytes(xdf({"My touch": ([], touch[1], touch[2])}).replace(b"_count>0<", b"_count>2<"))
    with pytest.raises(DataError, match=r"no channel 9 in My touch \(0, 1\)"):
        read_recordings((path,), HowToRead(screen=measured.screen, map=parse_map(["x=0", "y=9"])))
    path.write_bytes(b"XDF:" + b"\x01\xff" * 40)
    with pytest.raises(DataError, match=r"a\.xdf: (is not a sound XDF file|holds no stream)"):
        read_recordings((path,), HowToRead(screen=measured.screen))


def test_several_recordings_become_several_runs(measured: Session, tmp_path: Path) -> None:
    run = measured.runs[0]
    for name, shift_s in (("b.events", 100.0), ("a.events", 0.0)):
        (tmp_path / name).write_text(evemu(replace(run.touch, t_s=run.touch.t_s + shift_s)), "utf-8")
    session = read_recordings((tmp_path / "b.events", tmp_path / "a.events"))
    assert [one.id for one in session.runs] == ["a", "b"]


LINE = "Event: time 17.000100, type 3 (EV_ABS), code 53 (ABS_MT_POSITION_X), value 5\n"


@pytest.mark.parametrize(
    ("parse", "text", "message"),
    [
        (parse_evtest, LINE + "Event: time x\n" + LINE, "text, line 2: “Event: time x” is not an event of evtest"),
        (parse_evtest, LINE + LINE.replace("17.0001", "16.0001"), "text, line 2: the time goes back"),
        (parse_evtest, "nothing\n", "text: holds no events of evtest"),
        (parse_evtest, LINE.replace("code 53", "code 47").replace("value 5", "value 70000") + LINE, "text, line 1"),
        (parse_libinput, "version: 2\n", "text, line 1: only version 1"),
        (
            parse_libinput,
            "devices:\n- node: x\n  events:\n  - evdev:\n    - [1, 2, 3]\n",
            "text, line 5: “- [1, 2, 3]”",
        ),
        (parse_libinput, "devices:\n", "text: holds no events of a device"),
    ],
)
def test_a_malformed_log_is_one_sentence_with_the_line(parse: Callable[[str], object], text: str, message: str) -> None:
    with pytest.raises(DataError) as caught:
        parse(text)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("end", "cut"),
    [
        ("", False),
        (LINE, False),
        (LINE.rstrip(), False),  # a last line without an end that is whole
        ("Event: time 17.0003", True),
        ("Event: time 17.0003\n", True),
        ("Eve", True),
    ],
)
def test_a_log_of_evtest_that_is_cut_off_says_so(end: str, cut: bool) -> None:
    log = parse_evtest(LINE + end)
    assert (log.cut, len(log.events)) == (cut, 1 + (LINE.rstrip() in end))


@pytest.mark.parametrize(
    ("laser", "mapped", "said"),
    [
        (None, (), "there is no laser file"),
        ("t_s,light\n", (), "a.laser.csv: holds no edges"),
        (
            "t_s,light\n1,0.1\n2,0.2\n",
            ("laser.light=light:>1.5",),
            "a.laser.csv: holds no edges, its signal never crosses 1.5",
        ),
    ],
)
def test_a_run_without_edges_says_why(tmp_path: Path, laser: str | None, mapped: tuple[str, ...], said: str) -> None:
    (tmp_path / "a.csv").write_text("t_s,x_mm,y_mm\n1,2,3\n2,4,5\n", "utf-8")
    if laser is not None:
        (tmp_path / "a.laser.csv").write_text(laser, "utf-8")
    screen = Screen("s", 300.0, 200.0, 1920, 1080)
    session = read_recordings((tmp_path / "a.csv",), HowToRead(screen=screen, map=parse_map(mapped)))
    assert [note.text for note in session.runs[0].log] == [f"a.csv: {said}"]


def run_import(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["import", *map(str, arguments)])


def test_the_command_imports_and_says_what_it_assumed(measured: Session, tmp_path: Path) -> None:
    run: Run = measured.runs[0]
    (tmp_path / "a.events").write_text(evemu(run.touch), "utf-8")
    done = run_import(tmp_path / "a.events", "--protocol", "circle", "--out", tmp_path / "s.h5")
    assert done.exit_code == 0, done.stderr
    assert "there is no laser file" in done.stderr
    assert "the stylus is taken to be 7 mm wide" in done.stderr
    assert read_session(tmp_path / "s.h5").runs[0].protocol == "circle"


@pytest.mark.parametrize(
    ("table", "options", "message"),
    [
        ("t_s,x_mm,y_mm\n1,2,3\n", (), "does not describe the screen. Give --screen"),
        ("t_s,x_mm,y_mm\n1,2,3\n", ("--screen", "screen-1", "--map", "z=a"), "--map z=a: is not KEY=COLUMN[:UNIT]"),
        ("t_s,x_mm,y_mm\n1,2,3\n", ("--screen", "screen-1", "--map", "t=t_s:h"), "“h” is no unit of t"),
        ("t_s,x_mm,y_mm\n1,2,3\n", ("--screen", "screen-1", "--map", "x=x_mm:raw"), "Give --units-per-mm"),
        ("t_s,x,y_mm\n1,2,3\n", ("--screen", "screen-1"), "no column x_mm"),
        (
            "# by hand\nt_s,x_mm,y_mm\n2,2,3\n# pause\n1,2,3\n",
            ("--screen", "screen-1"),
            "line 5: times must be numbers",
        ),
        ("t_s,x_mm,y_mm\n1,2,3,4\n", ("--screen", "screen-1"), "line 2: expected 3 cells"),
    ],
)
def test_a_table_that_cannot_be_used_is_one_sentence(
    tmp_path: Path, table: str, options: tuple[str, ...], message: str
) -> None:
    (tmp_path / "a.csv").write_text(table, "utf-8")
    done = run_import(tmp_path / "a.csv", *options, "--out", tmp_path / "s.h5")
    assert (done.exit_code, done.stderr.count("\n")) == (1, 1), done.stderr
    assert message in done.stderr
    assert not (tmp_path / "s.h5").exists()


def test_clocks_that_share_no_moment_are_refused(measured: Session, tmp_path: Path) -> None:
    run = measured.runs[0]
    (tmp_path / "a.events").write_text(evemu(run.touch), "utf-8")
    (tmp_path / "a.laser.csv").write_text(laser_csv(replace(run.laser, t_s=run.laser.t_s - EPOCH_S)), "utf-8")
    with pytest.raises(DataError, match="share no moment"):
        read_recordings((tmp_path / "a.events",))
    session = read_recordings((tmp_path / "a.events",), HowToRead(map=parse_map([f"laser.clock={EPOCH_S}"])))
    np.testing.assert_allclose(session.runs[0].laser.t_s, run.laser.t_s, atol=1e-6)


def test_a_file_of_no_known_format_names_the_formats(tmp_path: Path) -> None:
    (tmp_path / "a.dat").write_text("something\n", "utf-8")
    with pytest.raises(DataError, match="--format: evtest, evemu, libinput, xdf, csv"):
        format_of(tmp_path / "a.dat")
