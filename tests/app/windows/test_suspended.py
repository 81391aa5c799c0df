"""A computer that was suspended during a run: the window says so, and the run carries the flag."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from draglag_app.session.machine import Phase
from draglag_app.session.standstill import Pulse
from draglag_app.windows.window import OperatorWindow

SLEPT_S = 3600.0


@pytest.fixture
def asleep_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """How long the computer has slept so far, as its clocks show it."""
    slept_s = [0.0]

    def clocks() -> tuple[float, float]:
        now_s = time.monotonic()  # stands still in a sleep, unlike CLOCK_BOOTTIME
        return now_s, now_s + slept_s[0]

    monkeypatch.setattr("draglag_app.session.watch.Pulse", lambda: Pulse(clocks))
    return slept_s


@pytest.mark.usefixtures("short_countdown")
def test_a_suspended_computer_is_said_in_the_window_and_flags_the_run(
    open_window: Callable[..., OperatorWindow], until: Callable, asleep_s: list[float]
) -> None:
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "offscreen"})
    run = window.space.protocol.runs[1].model_copy(update={"speeds_mm_s": (425.0, 600.0), "duration_s": 4.0})
    plan = window.space.protocol.model_copy(update={"runs": (run,), "taps": None, "rest_s": 600.0})
    window.space.set_protocol(plan)
    window.ask("start")
    until(lambda: window.record._phase is Phase.RECORDING)
    asleep_s[0] = SLEPT_S
    until(lambda: bool(window.notice_text.text()))
    assert window.notice_text.text().startswith(
        "computer: the computer was suspended for 3600.0 s: nothing was recorded"
    )
    assert "record the run again" in window.notice_text.text()
    assert window.notice.property("level") == "error"
    assert window.notice.isVisible()
    log = window.pages["log"][1].table
    assert "suspended for 3600.0 s" in log.item(log.rowCount() - 1, 3).text()
    until(lambda: "standstill" in window.record.big.text())
    assert window.record.big.text().startswith("✕")
    assert "recorded again at the end" in window.record.small.text()
    verdict = window.record.table.item(0, 5)
    assert verdict.text().startswith("✕ standstill")
    assert "stood still" in verdict.toolTip()
    window.ask("stop")
    until(lambda: window.space.analysis is not None and not window.space.tasks.running)
    results = window.pages["results"][1].table
    assert results.item(0, 5).text().startswith("✕")
    assert "standstill" in results.item(0, 5).text()
