"""The commands ``record`` and ``devices``."""

import json

import click
import numpy as np
import pytest
from click.testing import CliRunner

from draglag.errors import DraglagError
from draglag.instruments.calibration import target_places
from draglag.protocol.presets import load_screen
from draglag.store import read_session
from draglag_app.calibrating import as_recorded, fit_touches
from draglag_app.cli.devices import devices
from draglag_app.cli.record import display_number, progress_printer, record
from draglag_app.session import events
from draglag_devices.calibration import save_calibration
from draglag_devices.discovery import Found
from draglag_devices.sim.world import DIGITISER

SHORT = """name = "short"
rest_s = 1.0
[[runs]]
kind = "circle"
speeds_mm_s = [300, 600]
duration_s = 3.0
[taps]
count = 5
"""


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    return str(path)


def invoke(*words):
    return CliRunner().invoke(record, [str(word) for word in words])


def test_a_protocol_is_recorded_from_simulated_sources(short, tmp_path):
    out = tmp_path / "s.h5"
    result = invoke(short, "--touch", "sim:", "--laser", "sim:", "--walt", "sim:", "--display", "offscreen",
                    "--out", out, "--seed", 3)  # fmt: skip
    assert result.exit_code == 0, result.output
    session = read_session(out)
    assert [run.outcome for run in session.runs] == ["complete", "complete"]
    assert len(session.taps.physical_s) == 10
    assert session.seed == 3
    assert session.screen.width_mm == 509.2
    assert session.beam is not None
    assert session.protocol_toml == SHORT


def test_the_address_may_choose_the_screen(short, tmp_path):
    sim = "sim:?screen=screen-2"
    result = invoke(short, "--touch", sim, "--laser", sim, "--walt", sim, "--out", tmp_path / "s.h5")
    assert result.exit_code == 0, result.output
    assert read_session(tmp_path / "s.h5").screen.width_mm == 304.1


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--touch", "usb:1", "--laser", "sim:"], "not a device address"),
        (["--touch", "sim:"], "needs a laser"),
        (["--touch", "sim:", "--laser", "sim:", "--screen", "screen-9"], "screen-9"),
        (["--touch", "replay:none.h5", "--laser", "sim:"], "no such file"),
    ],
)
def test_what_cannot_be_measured_is_one_sentence(short, tmp_path, words, problem):
    result = invoke(short, *words, "--out", tmp_path / "s.h5")
    assert isinstance(result.exception, DraglagError)
    assert problem in str(result.exception)
    assert not list(tmp_path.glob("s.h5*"))


@pytest.fixture
def calibration(tmp_path):
    """Of the simulated digitiser, with touches that are a millimetre off to the right."""
    screen = load_screen("screen-1")
    x_mm, y_mm = target_places(screen.width_mm, screen.height_mm, 9)
    (xx, xy, x0), (yx, yy, y0) = DIGITISER
    x_raw, y_raw = (xx * (x_mm + 1) + xy * y_mm + x0, yx * (x_mm + 1) + yy * y_mm + y0)
    fit = fit_touches(x_raw, y_raw, screen)
    path = tmp_path / "touchscreen.json"
    save_calibration(fit, path, "a panel", as_recorded(fit, x_raw, y_raw, screen, "a panel", "2026-01-02T03:04:05"))
    return path, fit, x_raw


def test_a_saved_calibration_maps_positions_and_is_kept_with_them(short, tmp_path, calibration):
    path, fit, x_raw = calibration
    sims = ("--touch", "sim:", "--laser", "sim:", "--walt", "sim:")
    result = invoke(short, *sims, "--out", tmp_path / "s.h5", "--calibration", path)
    assert result.exit_code == 0, result.output
    session = read_session(tmp_path / "s.h5")
    touch = session.runs[0].touch
    assert np.array([touch.x_mm, touch.y_mm]) == pytest.approx(np.array(fit(touch.x_raw, touch.y_raw)))
    kept = session.calibration
    assert kept.matrix == pytest.approx(fit.matrix)
    assert kept.x_raw == pytest.approx(x_raw)
    assert (kept.device, kept.made_utc) == ("a panel", "2026-01-02T03:04:05")


def test_a_calibration_that_cannot_be_used_is_one_sentence(short, tmp_path, calibration):
    path, _, _ = calibration
    invoke(short, "--touch", "sim:", "--laser", "sim:", "--walt", "sim:", "--out", tmp_path / "tape.h5")
    wrong = tmp_path / "wrong.json"
    wrong.write_text("{}")
    for touch, file, problem in (
        ("sim:", tmp_path / "none.json", "none.json: cannot be read"),
        ("sim:", wrong, "is not a calibration"),
        (f"replay:{tmp_path / 'tape.h5'}", path, "only a touchscreen"),
        (f"evdev:/dev/input/event77?calibration={path}", path, "a calibration of its own"),
    ):
        result = invoke(short, "--touch", touch, "--laser", "sim:", "--screen", "screen-1", "--realtime",
                        "--out", tmp_path / "s.h5", "--calibration", file)  # fmt: skip
        assert isinstance(result.exception, DraglagError), touch
        assert problem in str(result.exception)
        assert result.exception.remedy
        assert not list(tmp_path.glob("s.h5*"))


def test_an_existing_file_is_not_overwritten(short, tmp_path):
    out = tmp_path / "s.h5"
    out.write_text("mine")
    result = invoke(short, "--touch", "sim:", "--laser", "sim:", "--out", out)
    assert "not overwritten" in str(result.exception)
    assert out.read_text() == "mine"


@pytest.mark.parametrize(
    ("display", "word", "number"),
    [("offscreen", None, None), ("screen", "2", 2), ("screen 2", None, 2), ("screen", None, 1)],
)
def test_displays(display, word, number):
    assert display_number(display, word) == number


@pytest.mark.parametrize(
    ("display", "word"), [("window", None), ("screen", "x"), ("screen 0", None), ("offscreen", "2")]
)
def test_unknown_displays_are_wrong_usage(display, word):
    with pytest.raises(click.UsageError):
        display_number(display, word)


def test_devices_lists_the_simulator_and_the_forms():
    plain, as_json = CliRunner().invoke(devices, []), CliRunner().invoke(devices, ["--json"])
    assert plain.exit_code == as_json.exit_code == 0
    assert "evdev:/dev/input/eventN" in plain.output
    assert json.loads(as_json.output)["devices"][0]["address"] == "sim:"


def test_devices_asks_the_interfaces_it_is_given(monkeypatch):
    asked = []

    def look(probe):
        asked.append(probe)
        return [Found("ethercat:lo?channel=1", ("laser",), "network interface lo: has the address 127.0.0.1", False)]

    monkeypatch.setattr("draglag_app.cli.devices.discover", look)
    assert "has the address" in CliRunner().invoke(devices, []).output
    assert CliRunner().invoke(devices, ["--probe", "lo"]).exit_code == 0
    assert asked == [(), ("lo",)]
    refused = CliRunner().invoke(devices, ["--probe", "no-such0"])
    assert isinstance(refused.exception, DraglagError)
    assert "there is no network interface called no-such0" in refused.exception.problem


def test_a_recording_in_which_nothing_was_touched_is_one_sentence_and_exit_1(short, tmp_path):
    trace = tmp_path / "late.csv"
    trace.write_text("t_s,x_mm,y_mm\n")
    words = ["--touch", f"csv:{trace}", "--laser", "sim:", "--screen", "screen-1", "--out", tmp_path / "s.h5"]
    plain = tmp_path / "runs.toml"
    plain.write_text((tmp_path / "short.toml").read_text().split("[taps]")[0])
    result = invoke(plain, *words)
    assert isinstance(result.exception, DraglagError)
    assert "No touch was recorded in any run" in result.exception.problem
    assert str(tmp_path / "s.h5") in result.exception.remedy


def test_a_device_that_is_back_is_said_on_the_terminal(capsys):
    show = progress_printer()
    show(events.NoticeRaised(1.0, "error", "laser", "The laser sensor is lost.", "lost"))
    show(events.NoticeRaised(2.0, "info", "laser", "The laser sensor is back.", "back"))
    show(events.NoticeRaised(3.0, "info", "laser", "0.1 % of the cycles were disturbed."))
    assert capsys.readouterr().err.splitlines() == [
        "laser: The laser sensor is lost.",
        "laser: The laser sensor is back.",
    ]
