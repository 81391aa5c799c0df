"""Renders pages with a finished simulated session and during a run: ``./run screenshots``.

Pictures go to docs/pictures (those the README and the manual show) or to the folder given. ``--all``: every page and
state in both themes, on screens of three sizes, at two scalings.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

sys.path.insert(0, str(Path(__file__).parents[1]))

from PySide6.QtWidgets import QApplication, QWidget

from app import manual_pictures
from app.screenshot_camera import SCALINGS, Camera, on_screens
from app.screenshot_states import participants, take_all
from draglag_app.windows.application import make_application
from draglag_app.windows.settings import RigSettings, Settings
from draglag_app.windows.window import OperatorWindow

PICTURES = Path(__file__).parents[2] / "docs" / "pictures"
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


def measured(application: QApplication, settings: Settings, folder: Path) -> OperatorWindow:
    """A window with a finished session, a calibration and a curve to compare."""
    window = OperatorWindow(settings, folder / "settings.toml")
    window.show()
    window.start()
    wait(application, lambda: window.space.analysis is not None and not window.space.tasks.running)
    window.notify("", "")
    window.bench.look()
    window.ask("calibrate")
    wait(application, lambda: not window.space.calibrating.active)
    window.pages["compare"][1]._add_present()
    return window


def take_shown(application: QApplication, window: OperatorWindow, folder: Path, out: Path) -> None:
    """What the README shows: results, a run under way, and what the participant sees."""
    window.use_theme("dark")
    window.go("results")
    wait(application, lambda: not window.space.tasks.running)
    shoot(window, out / "window-results.png")
    window.close()
    rig = SIMULATED.model_copy(update={"fast": False, "display": "window"})
    window = OperatorWindow(
        Settings(first_start=False, folder=str(folder), protocol="demo", rig=rig), folder / "live.toml"
    )
    window.show()
    manual_pictures.into_the_second_run(application, window, wait)
    shoot(window, out / "window-recording.png")
    seen = {"participant": window.space.recording.window, "participant-practice": dict(participants())["practice"]}
    for name, participant in seen.items():
        if participant is not None:
            participant.resize(960, 540)  # off screen there is little room next to the operator's window
            shoot(participant, out / f"{name}.png")
    manual_pictures.leave(application, window, wait)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=PICTURES)
    parser.add_argument("--language", default="en", help="of the windows, for looking at: en or nl")
    parser.add_argument("--all", action="store_true", help="every state, theme, size and scaling, for looking at")
    parser.add_argument("--manual", action="store_true", help="the pictures of the manual, into its folder, alone")
    parser.add_argument("--scaling", type=int, choices=SCALINGS, help=argparse.SUPPRESS)  # of a process of --all
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if chosen.all:
            words = (__file__, "--out", str(chosen.out), "--language", chosen.language, "--scaling")
            started = [[sys.executable, *words, str(scaling)] for scaling in SCALINGS]
            return max(
                subprocess.run(line, env=on_screens(folder, scaling), check=False).returncode
                for line, scaling in zip(started, SCALINGS, strict=True)
            )
        if chosen.manual:
            manual_pictures.make(make_application(sys.argv[:1]), folder, manual_pictures.FOLDER, wait)
            return 0
        settings = Settings(
            first_start=False, folder=str(folder / "sessions"), protocol="demo", rig=SIMULATED, language=chosen.language
        )
        application = make_application(sys.argv[:1], settings)
        window = measured(application, settings, folder)
        if chosen.scaling:
            take_all(application, window, folder, Camera(chosen.out, chosen.scaling, wait))
        else:
            take_shown(application, window, folder / "live", chosen.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
