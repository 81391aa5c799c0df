"""The operator's station under load: ``./run bench window [SECONDS]`` (default 60).

Records one circle from the simulated rig in real time, digitiser at 1 kHz, participant's window and Record page in
sight. Use Xvfb (``xvfb-run -s "-screen 0 1920x1080x24"``) for a window system with costs; ``QT_QPA_PLATFORM=offscreen``
measures drawing alone. Prints what preceded each late frame, and what an idle process misses. The measurement itself
takes about 1.3 % of a core, included in the process's figure.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from late_frames import LateFrames
from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QApplication

from draglag.protocol.runs import load_protocol
from draglag_app.session import events
from draglag_app.windows.application import make_application
from draglag_app.windows.settings import PanelSettings, RigSettings, Settings
from draglag_app.windows.window import OperatorWindow
from draglag_resources import resource

_RATE_HZ = 1000.0
_PULSE_MS = 5
_PAGES = ("bench", "geometry", "protocol", "record", "results", "gap", "compare", "log", "preferences", "help")


def quick_screen(folder: Path) -> Path:
    """The preset's screen with a digitiser of 1 kHz."""
    text = resource("screens", "screen-1.toml").read_text("utf-8")
    path = folder / "quick.toml"
    path.write_text(text.replace("touch_rate_hz = 120.0", f"touch_rate_hz = {_RATE_HZ}"), "utf-8")
    return path


class Pulse:
    """How late a timer of the window's thread fires, s, since ``begin``."""

    def __init__(self) -> None:
        self.late_s: list[float] = []
        self._last_s = 0.0
        self._timer = QTimer()
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._tick)

    def begin(self) -> None:
        self._last_s = time.monotonic()
        self._timer.start(_PULSE_MS)

    def end(self) -> None:
        self._timer.stop()

    def _tick(self) -> None:
        now_s = time.monotonic()
        self.late_s.append(max(0.0, now_s - self._last_s - _PULSE_MS / 1e3))
        self._last_s = now_s


def load() -> str:
    return " ".join(f"{value:.2f}" for value in os.getloadavg())


def page_changes(application: QApplication, window: OperatorWindow) -> list[tuple[str, float]]:
    """(page, s) from the key to the drawn page, the second time it is shown."""
    for name in _PAGES:
        window.go(name)
        application.processEvents()
    out = []
    for name in _PAGES:
        start_s = time.perf_counter()
        window.go(name)
        window.repaint()
        application.processEvents()
        out.append((name, time.perf_counter() - start_s))
    return out


def measure(duration_s: float) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        screen = quick_screen(folder)
        settings = Settings(
            first_start=False, folder=str(folder / "sessions"),
            rig=RigSettings(touch="sim:", laser="sim:", display="window"), panel=PanelSettings(preset=str(screen)),
        )  # fmt: skip
        late_frames = LateFrames()
        application = make_application(["bench"], settings)
        late_frames.listen()
        window = OperatorWindow(settings, folder / "settings.toml")
        demo = load_protocol("demo")
        circle = demo.runs[0].model_copy(update={"speeds_mm_s": (240.0,), "duration_s": duration_s, "practice": False})
        window.space.set_protocol(demo.model_copy(update={"runs": (circle,), "taps": None, "clock_check": None}))
        window.resize(1280, 800)
        window.show()
        application.processEvents()
        changes = page_changes(application, window)
        pulse, marks = Pulse(), {}
        bridge = window.space.bridge

        def begun(event: events.RunStarted) -> None:
            marks["wall"], marks["cpu"] = time.monotonic(), time.process_time()
            pulse.begin()
            late_frames.begin(event.start_s)

        def over(event: events.RunFinished) -> None:
            pulse.end()
            late_frames.end()
            marks["wall"] = time.monotonic() - marks["wall"]
            marks["cpu"] = time.process_time() - marks["cpu"]
            marks["end"] = event.run.start_s + event.run.duration_s
            marks["run"] = event.run

        def estimated() -> None:
            if not window.space.live.known:
                return
            marks.setdefault("known", time.monotonic())
            if not window.space.live.preliminary:
                marks.setdefault("whole", time.monotonic())

        bridge.run_started.connect(begun)
        bridge.run_finished.connect(over)
        window.space.live.changed.connect(estimated)
        print(f"load average before: {load()}; {os.cpu_count()} cores; {application.platformName()}")
        window.ask("start")
        watch = QTimer()
        watch.timeout.connect(
            lambda: application.quit() if "whole" in marks and not window.space.recording.active else None
        )
        watch.start(50)
        application.exec()
        watch.stop()
        window.shut_down()
        run = marks["run"]
        late_ms = 1e3 * np.array(pulse.late_s)
        print(f"load average after:  {load()}")
        print(f"touch events saved: {len(run.touch.t_s)} in {run.duration_s:.0f} s; lost: {run.touch.dropped}")
        frames = 0 if run.display is None else len(run.display.t_s)
        print(f"frames drawn: {frames}; missed slots: {0 if run.display is None else run.display.missed} (bar: 0)")
        print(late_frames.reported())
        print(f"CPU of the whole process: {100 * marks['cpu'] / marks['wall']:.1f} % of one core (bar: 15)")
        p50, p99 = np.percentile(late_ms, [50, 99])
        print(f"event loop late, p50 / p99 / max: {p50:.1f} / {p99:.1f} / {late_ms.max():.1f} ms (bar: p99 30)")
        known_s, whole_s = marks["known"] - marks["end"], marks["whole"] - marks["end"]
        print(f"estimate after the run's end: {known_s:.2f} s (bar: 0.5); with its last events: {whole_s:.2f} s")
        print("page changes: " + ", ".join(f"{page} {1e3 * s:.0f} ms" for page, s in changes) + " (bar: 100)")
        window.close()


if __name__ == "__main__":
    measure(float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
