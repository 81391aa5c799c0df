"""The check of the rig on the page Bench: every check of ``draglag check``, with remedies that name buttons."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QPushButton

from draglag.messages import message
from draglag.protocol.runs import load_protocol
from draglag_app.preflight import Check
from draglag_app.windows.pages import bench
from draglag_app.windows.settings import RigSettings
from draglag_app.windows.start import obstacles
from draglag_app.windows.window import OperatorWindow
from message_templates import shell_command


@pytest.fixture(autouse=True)
def short_look(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "_WATCH_S", 0.3)


def checked(window: OperatorWindow, until: Callable) -> list[str]:
    """Press Check the rig; the lines that the page lists then."""
    window.go("bench")
    button = window.bench.check_button
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)
    assert not button.isEnabled()
    until(lambda: button.isEnabled() and not window.space.tasks.running)
    assert window.bench.list.isVisible()
    return window.bench.list.toPlainText().replace("\xa0", " ").splitlines()


def test_the_window_checks_all_that_the_command_line_checks(open_window: Callable, until: Callable) -> None:
    window = open_window()
    lines = checked(window, until)
    names = [line[2:].split("   ")[0] for line in lines if line[0] in "✓▲✕"]
    assert names == [
        "disk", "touchscreen", "touch events", "laser sensor", "laser edges", "laser's clock",
        "drift of the laser's clock", "WALT", "WALT's clock", "drift of the WALT's clock",
    ]  # fmt: skip
    assert "GB free (limit 0.2 GB)" in lines[0]
    assert not [line for line in lines if line.startswith("✕")]
    assert "every instrument answers" in window.notice_text.text()
    assert {light.state for light in (*window.bench.lights.values(), *window.header.lights.values())} == {"ready"}


def test_what_fails_is_listed_with_the_button_to_press(open_window: Callable, until: Callable, tmp_path: Path) -> None:
    window = open_window(rig={"touch": "sim:", "laser": f"serial:{tmp_path}/ttyACM0?role=laser", "walt": "usb:3"})
    lines = checked(window, until)
    failed = [k for k, line in enumerate(lines) if line.startswith("✕")]
    assert [lines[k][2:].split("   ")[0] for k in failed] == ["laser sensor", "WALT"]
    assert "Look for devices, on the page Bench, lists it" in lines[failed[0] + 1]
    assert "usb:3: this is not a device address" in lines[failed[1]]
    assert window.notice_text.text().startswith(f"Not ready: 2 of {sum(line[0] in '✓▲✕' for line in lines)} checks")
    states = {role: light.state for role, light in window.bench.lights.items()}
    assert states == {"touch": "ready", "laser": "fault", "walt": "fault"}
    assert "Look for devices" in window.bench.words["laser"].text()
    assert not [line for line in lines if shell_command(line)]


def test_what_nobody_did_while_it_was_watched_is_a_remark_that_names_the_button(
    open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [
        Check("touch", "ok", "a panel"),
        Check("touch events", "warning", message("none"), "≥ 50 Hz", message("draw while checking")),
    ]
    monkeypatch.setattr(bench, "check_devices", lambda *asked: rows)
    window = open_window(rig={"touch": "evdev:/dev/input/event5", "laser": "ethercat:eth9", "display": "window"})
    lines = checked(window, until)
    assert lines[1:] == [
        "▲ touch events   none (limit ≥ 50 Hz)",
        "   → press Check the rig again, and draw on the screen while it is watched",
    ]
    assert window.bench.lights["touch"].state == "ready"  # the panel answers
    assert window.notice_text.text().endswith("The page Bench lists what to look at: 1 of 2.")


def test_a_check_is_cancelled(open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "_WATCH_S", 600.0)
    window = open_window()
    window.ask("check")
    until(lambda: window.notice.cancel.isVisible())
    window.ask("cancel")
    until(lambda: not window.space.tasks.running)
    assert window.bench.check_button.isEnabled()


def test_every_obstacle_of_the_bench_says_which_button_or_box_to_use(open_window: Callable, qapp: QApplication) -> None:
    window = open_window(rig=RigSettings())
    window.go("bench")
    qapp.processEvents()
    there = {one.text() for one in window.bench.findChildren(QPushButton) + window.bench.findChildren(QLabel)}
    names = {text for text in there if len(text) > 3 and text in ("Look for devices", "WALT (taps)", "Laser sensor")}
    assert names == {"Look for devices", "WALT (taps)", "Laser sensor"}
    met = set()
    for rig in (RigSettings(), RigSettings(touch="sim:"), RigSettings(touch="sim:", laser="sim:")):
        for protocol in ("demo", "taps-100", "clock-check", "quick"):
            window.space.change_settings(rig=rig)
            window.space.set_protocol(load_protocol(protocol))
            met |= {one.sentence for one in obstacles(window.space) if one.page == "bench"}
    assert len(met) >= 4
    for sentence in met:
        assert "on the page Bench" in sentence
        assert [name for name in names if name in sentence], sentence
        assert not shell_command(sentence)
