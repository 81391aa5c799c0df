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

sys.path.insert(0, str(Path(__file__).parents[1]))

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication, QWidget

from app import manual_pictures
from app.screenshot_dialogs import questions, troubles, under_way
from draglag.exchange import read_exchange
from draglag.protocol.targets import Circle, Tap
from draglag.recording import Screen
from draglag_app.windows.application import make_application
from draglag_app.windows.participant.window import ParticipantWindow
from draglag_app.windows.settings import RigSettings, Settings
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.i18n import translate

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
    window.show()
    manual_pictures.into_the_second_run(application, window, wait)
    shoot(window, out / "window-recording.png")
    participant = window.space.recording.window
    if participant is not None:
        participant.resize(960, 540)  # off screen there is little room next to the operator's window
        shoot(participant, out / "participant.png")
    manual_pictures.leave(application, window, wait)


def close_the_gap(application: QApplication, window: OperatorWindow) -> None:
    """The Gap page with its steps."""
    window.go("gap")
    page = window.pages["gap"][1]
    page.start()
    wait(application, lambda: not window.space.tasks.running)


def a_gap_closed(application: QApplication, window: OperatorWindow, out: Path) -> None:
    """The Gap page of a recorded session in which an effect is hidden."""
    window.space.take(read_exchange(Path(__file__).parents[1] / "data" / "exchange" / "low_speed_plateau"), None)
    wait(application, lambda: window.space.analysis is not None and not window.space.tasks.running)
    close_the_gap(application, window)
    window.resize(*SIZES["small"])
    for theme in ("dark", "light"):
        window.use_theme(theme)
        shoot(window, out / f"gap-closed-{theme}.png")


def results_in_full(application: QApplication, window: OperatorWindow, out: Path) -> None:
    """Every tab of the Results page and every picture of the Gap page, with a step chosen."""
    results, gap = window.pages["results"][1], window.pages["gap"][1]
    for theme in ("dark", "light"):
        window.space.change_settings(theme=theme)
        window.use_theme(theme)
        window.resize(*SIZES["small"])
        window.go("results")
        results.show_alternatives.setChecked(True)
        results._fit_alternatives()
        for k in range(results.tabs.count()):
            results.tabs.setCurrentIndex(k)
            results.table.selectRow(k)
            wait(application, lambda: not window.space.tasks.running)
            shoot(window, out / f"results-tab{k}-{theme}.png")
        results.show_alternatives.setChecked(False)
        results.tabs.setCurrentIndex(0)
        window.go("gap")
        gap.table.selectRow(0)
        for k in range(gap.picture.kind.count()):
            gap.picture.kind.setCurrentIndex(k)
            wait(application, lambda: not window.space.tasks.running)
            shoot(window, out / f"gap-picture{k}-{theme}.png")


def first_start(application: QApplication, folder: Path, out: Path) -> None:
    """As at the very first start, in both themes, and what is said where nothing has been measured."""
    for theme in ("dark", "light"):
        settings = Settings(folder=str(folder / "none"), theme=theme)
        window = OperatorWindow(settings, folder / f"first-{theme}.toml")
        window.use_theme(theme)
        window.show()
        for name in ("bench", "geometry", "record", "results", "gap", "compare", "log"):
            window.go(name)
            shoot(window, out / f"first-{name}-{theme}.png")
        window.ask("start")
        shoot(window, out / f"first-start-{theme}.png")
        window.close()
        window.deleteLater()
    application.sendPostedEvents(None, QEvent.Type.DeferredDelete)


def participant_states(out: Path) -> None:
    """Whatever the participant can be shown."""
    screen, now = Screen("screen-1", 509.2, 286.4, 1920, 1080), time.monotonic()
    circle = Circle(200, 143, 50, 100)

    def state(name: str, prepare: Callable[[ParticipantWindow], object], size: tuple[int, int] = (960, 540)) -> None:
        window = ParticipantWindow(screen)
        window.resize(*size)
        window.show()
        prepare(window)
        shoot(window, out / f"participant-{name}.png")
        window.close()

    def lost(window: ParticipantWindow) -> None:
        window.show_target(circle, now - 20)
        window.set_contact(True)
        window.set_contact(False)

    def over(window: ParticipantWindow) -> None:
        window.show_target(circle, now - 20)
        window.hide_target()

    state("begin", lambda window: window.show_target(circle, time.monotonic() + 2.5))
    state("running", lambda window: window.show_target(circle, now - 20))
    state("lost", lost)
    state("done", over)
    state("rest", lambda window: window.set_prompt("Rest"))
    state("clocks", lambda window: window.set_prompt("Comparing clocks: leave the screen alone"))
    state("tap", lambda window: window.show_target(Tap(254.6, 143.2, 100, 1.0), now))
    touch = translate("Calibration", "Touch the cross and lift: {k} of {n}").format(k=4, n=9)
    words = touch + "\n" + translate("Calibration", "The stylus slid: rest it on the cross without moving.")
    state("calibration", lambda window: window.show_cross(51, 143, words))


def participant(out: Path) -> None:
    """What the participant reads before a practice run."""
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
    parser.add_argument("--language", default="en", help="of the windows, for looking at: en or nl")
    parser.add_argument("--all", action="store_true", help="both sizes and every state, for looking at")
    parser.add_argument("--manual", action="store_true", help="the pictures of the manual, into its folder, alone")
    chosen = parser.parse_args()
    if chosen.manual:
        with tempfile.TemporaryDirectory() as name:
            manual_pictures.make(make_application(sys.argv[:1]), Path(name), manual_pictures.FOLDER, wait)
        return 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        settings = Settings(
            first_start=False, folder=str(folder / "sessions"), protocol="demo", rig=SIMULATED, language=chosen.language
        )
        application = make_application(sys.argv[:1], settings)
        window = OperatorWindow(settings, folder / "settings.toml")
        window.show()
        window.start()
        wait(application, lambda: window.space.analysis is not None and not window.space.tasks.running)
        window.notify("", "")
        window.bench.look()
        window.ask("calibrate")
        wait(application, lambda: not window.space.calibrating.active)
        compare = window.pages["compare"][1]
        compare._add_present()
        if chosen.all:
            close_the_gap(application, window)
        pages(application, window, chosen.out, list(SIZES) if chosen.all else ["small"])
        if chosen.all:
            results_in_full(application, window, chosen.out)
            for theme in ("dark", "light"):
                window.use_theme(theme)
                questions(window, theme, chosen.out, shoot)
                troubles(window, theme, chosen.out, shoot)
            a_gap_closed(application, window, chosen.out)
        window.close()
        if chosen.all:
            for theme in ("dark", "light"):
                under_way(application, folder / "under-way", theme, chosen.language, chosen.out, shoot, wait)
            first_start(application, folder, chosen.out)
            participant_states(chosen.out)
        during_a_run(application, folder / "live", chosen.out)
        participant(chosen.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
