"""Renders every page in both themes, with a finished simulated session and during a run: ``./run screenshots``.

Pictures go to docs/pictures (those the README and the manual show) or to the folder given.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication, QWidget

from draglag.protocols import load_protocol
from draglag.recording import Screen
from draglag.targets import Circle
from draglag_app.windows.application import make_application
from draglag_app.windows.participant import ParticipantWindow
from draglag_app.windows.settings import RigSettings, Settings
from draglag_app.windows.window import OperatorWindow

SIZES = {"small": (1280, 800), "large": (1920, 1080)}
SIMULATED = RigSettings(touch="sim:", laser="sim:", walt="sim:", fast=True, display="offscreen")


def wait(application: QApplication, until: Callable[[], bool], limit_s: float = 240.0) -> None:
    """Let the window live until something is so. Raises SystemExit when it never is."""
    end_s = time.monotonic() + limit_s
    while not until():
        application.processEvents()
        time.sleep(0.002)
        if time.monotonic() > end_s:
            raise SystemExit("the window did not get there in time")
    for _ in range(20):
        application.processEvents()


def shoot(widget: QWidget, path: Path) -> None:
    """One picture."""
    QApplication.processEvents()
    path.parent.mkdir(parents=True, exist_ok=True)
    widget.grab().save(str(path))


SHOWN = {"results-dark-small": "window-results"}
"""What is kept of the pages, under which name, when not all are asked for."""


def pages(application: QApplication, window: OperatorWindow, out: Path, sizes: list[str]) -> None:
    """Every page, both themes; only those in SHOWN unless both sizes are asked for."""
    for theme in ("dark", "light"):
        window.space.change_settings(theme=theme)
        window.use_theme(theme)
        for size in sizes:
            window.resize(*SIZES[size])
            for name in window.pages:
                window.go(name)
                wait(application, lambda: not window.space.tasks.running)
                if name == "protocol":
                    precision = window.pages[name][1].precision
                    wait(application, lambda precision=precision: precision.plan is not None)
                file = f"{name}-{theme}-{size}"
                if len(sizes) > 1 or file in SHOWN:
                    shoot(window, out / f"{SHOWN.get(file, file)}.png")


def during_a_run(application: QApplication, folder: Path, out: Path) -> None:
    """Record page and participant's display while a simulated run goes on in real time."""
    rig = SIMULATED.model_copy(update={"fast": False, "display": "window"})
    settings = Settings(first_start=False, folder=str(folder), protocol="demo", rig=rig)
    window = OperatorWindow(settings, folder / "settings.toml")
    window.use_theme("dark")
    demo = load_protocol("demo")
    fast = demo.runs[1].model_copy(update={"speeds_mm_s": (425.0, 760.0), "duration_s": 9.0})
    short = {"runs": (fast,), "taps": None, "clock_check": None, "rest_s": 1.0}
    window.space.set_protocol(demo.model_copy(update=short))
    window.show()
    window.start()
    wait(application, lambda: len(window.space.live.known) == 1, 40)
    end_s = time.monotonic() + 10
    wait(application, lambda: time.monotonic() > end_s)
    shoot(window, out / "window-recording.png")
    participant = window.space.recording.window
    if participant is not None:
        shoot(participant, out / "participant.png")
    window.shut_down()
    wait(application, lambda: not window.space.recording.active)
    window.close()
    application.sendPostedEvents(None, QEvent.Type.DeferredDelete)


def participant(out: Path) -> None:
    """What the participant is told before a practice run."""
    screen = Screen("screen-1", 509.2, 286.4, 1920, 1080)
    window = ParticipantWindow(screen)
    window.resize(960, 540)
    window.show()
    window.set_practice(True)
    window.show_target(Circle(200, 143, 50, 100), time.monotonic() + 2.5)
    shoot(window, out / "participant-practice.png")
    window.close()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[2] / "docs" / "pictures")
    parser.add_argument("--all", action="store_true", help="both sizes, for looking at; else the small one")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        settings = Settings(first_start=False, folder=str(folder / "sessions"), protocol="demo", rig=SIMULATED)
        application = make_application(sys.argv[:1], settings)
        window = OperatorWindow(settings, folder / "settings.toml")
        window.show()
        window.start()
        wait(application, lambda: window.space.analysis is not None and not window.space.tasks.running)
        window.tell("", "")
        window.bench.look()
        window.ask("calibrate")
        wait(application, lambda: not window.space.calibrating.active)
        compare = window.pages["compare"][1]
        compare._add_present()
        pages(application, window, chosen.out, list(SIZES) if chosen.all else ["small"])
        window.close()
        during_a_run(application, folder / "live", chosen.out)
        participant(chosen.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
