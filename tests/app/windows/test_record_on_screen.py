"""``draglag record --display screen N``: the participant's keys."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QEventLoop, Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from app.session_rigs import NeedsPanel, fast_rig, of_role, protocol
from draglag.protocol.presets import load_screen
from draglag.store import read_session
from draglag_app.session import Control, Display, SessionOptions, events, run_session
from draglag_app.windows.pages import bench
from draglag_app.windows.participant.screen_display import record_on_screen
from draglag_app.windows.participant.window import ParticipantWindow
from draglag_app.windows.settings import PanelSettings
from draglag_devices.rig import Rig, make_rig


@pytest.fixture
def escape(qapp: QApplication) -> Iterator[threading.Event]:
    """Esc is pressed on the participant's screen once this is set."""
    wanted = threading.Event()
    timer = QTimer()

    def look() -> None:
        windows = [w for w in qapp.topLevelWidgets() if isinstance(w, ParticipantWindow) and w.isVisible()]
        if wanted.is_set() and windows:
            wanted.clear()
            QTest.keyClick(windows[0], Qt.Key.Key_Escape)

    timer.timeout.connect(look)
    timer.start(10)
    yield wanted
    timer.stop()
    timer.deleteLater()


def test_escape_aborts_the_run_and_the_session_goes_on(tmp_path: Path, escape: threading.Event) -> None:
    rig = make_rig(dict.fromkeys(("touch", "laser"), "sim:"), "screen-1", 1, fast=False)
    plan = protocol(300, 600, duration_s=60.0).model_copy(update={"rest_s": 0.1})
    quick = plan.runs[0].model_copy(update={"speeds_mm_s": (600.0,), "duration_s": 1.0})
    long = plan.runs[0].model_copy(update={"speeds_mm_s": (300.0,)})
    plan = plan.model_copy(update={"runs": (long, quick)})
    control, options = Control(), SessionOptions(load_screen("screen-1"), countdown_s=0.1)

    def listener(event: events.Event) -> None:
        if isinstance(event, events.RunStarted) and event.run_id == "run-01":
            escape.set()

    def measure(display: Display) -> Path:
        return run_session(plan, rig, display, tmp_path / "s.h5", options, listener, control)

    path = record_on_screen(1, measure, options.screen, control)
    session = read_session(path)
    assert [run.outcome for run in session.runs] == ["aborted", "complete"]
    assert session.runs[0].duration_s < 60.0
    # No wish to quit is left over, which would end whatever is opened next, a question say, before it is seen.
    asking = QEventLoop()
    QTimer.singleShot(0, lambda: asking.exit(7))
    assert asking.exec() == 7


def test_the_bench_gives_a_touchscreen_the_size_of_the_panel(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    rig = fast_rig()
    source = NeedsPanel(of_role(rig, "touch"))
    monkeypatch.setattr("draglag_app.preflight.make_rig", lambda *a, **k: Rig((source,), rig.stage))
    panel = PanelSettings(width_mm=301.0)
    found = bench.check_devices({"touch": "evdev:x"}, panel, tmp_path, lambda done, text: None)
    assert [check.state for check in found if check.name == "touch"] == ["ok"]
    assert source.panel_mm == (301.0, load_screen("screen-1").height_mm)
