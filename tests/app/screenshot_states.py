"""All states of the windows, for ``./run screenshots --all``: a generator prepares one and gives its name."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication

from app import manual_pictures
from app.screenshot_camera import Camera
from app.screenshot_dialogs import in_a_rest, on_one_monitor, questions, troubles
from draglag.exchange import read_exchange
from draglag.protocol.targets import Circle, Tap
from draglag.recording import Screen
from draglag_app.windows.participant.window import ParticipantWindow
from draglag_app.windows.settings import Settings
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.i18n import translate

EXCHANGE = Path(__file__).parents[1] / "data" / "exchange"
HIDDEN = "low_speed_plateau"
"""The effect in the sample session of the Gap page."""
UNNAMED = {"covariate": "session_time", "probability": 0.8}


def take_all(application: QApplication, window: OperatorWindow, folder: Path, camera: Camera) -> None:
    """Every state of the windows. ``window`` shows a finished session."""
    settings = window.space.settings
    states = (measured, results_in_full, troubles, gap_of_a_sample)
    _close_the_gap(application, window, camera)
    for state in states:
        for name in state(application, window, camera):
            camera.take(window, name)
        if state is results_in_full:
            questions(window, camera)
    window.close()
    first_start(application, settings, folder, camera)
    for under_way in (in_a_rest, on_one_monitor, _in_a_run):
        under_way(application, settings, folder / under_way.__name__, camera)
    for name, participant in participants():
        camera.take(participant, f"participant-{name}", ("dark",))  # who follows the target has no themes
        participant.close()


def measured(application: QApplication, window: OperatorWindow, camera: Camera) -> Iterator[str]:
    """Every page."""
    for name in window.pages:
        window.go(name)
        yield name


def results_in_full(application: QApplication, window: OperatorWindow, camera: Camera) -> Iterator[str]:
    """Every tab of the Results page and every picture of the Gap page, with a row chosen."""
    results, gap = window.pages["results"][1], window.pages["gap"][1]
    window.go("results")
    results.show_alternatives.setChecked(True)
    results._fit_alternatives()
    for k in range(results.tabs.count()):
        results.tabs.setCurrentIndex(k)
        results.table.selectRow(k)
        yield f"results-tab{k}"
    results.show_alternatives.setChecked(False)
    results.tabs.setCurrentIndex(0)
    window.go("gap")
    gap.table.selectRow(0)
    for k in range(gap.picture.kind.count()):
        gap.picture.kind.setCurrentIndex(k)
        yield f"gap-picture{k}"
    gap.picture.kind.setCurrentIndex(0)


def _close_the_gap(application: QApplication, window: OperatorWindow, camera: Camera) -> None:
    window.go("gap")
    window.pages["gap"][1].start()
    camera.wait(application, lambda: not window.space.tasks.running)


def gap_of_a_sample(application: QApplication, window: OperatorWindow, camera: Camera) -> Iterator[str]:
    """The Gap page of a session in which an effect is hidden, found or not."""
    window.space.take(read_exchange(EXCHANGE / HIDDEN), None)
    camera.wait(application, lambda: window.space.analysis is not None and not window.space.tasks.running)
    _close_the_gap(application, window, camera)
    page = window.pages["gap"][1]
    yield "gap-closed"
    found = page._report
    left_mm = found["gap_first_mm"]
    sets = [
        {"effects": ["unexplained"], "probability": 0.93},
        {"effects": ["direction_asymmetry"], "probability": 0.06},
    ]
    unexplained = {
        **found, "verdict": "unexplained", "unexplained_by": UNNAMED["covariate"], "gap_last_mm": left_mm,
        "steps": [], "explanations": sets, "provisional": None,
    }  # fmt: skip
    page.show_report(unexplained)
    yield "gap-unexplained"
    doubted = [{**step, "probability": 0.31, "gap_after_mm": 0.8 * left_mm} for step in found["steps"][:1]]
    term = {**UNNAMED, "gap_before_mm": 0.8 * left_mm, "gap_after_mm": found["gap_last_mm"]}
    page.show_report({**unexplained, "steps": doubted, "provisional": term, "gap_last_mm": 0.8 * left_mm})
    yield "gap-provisional"


def first_start(application: QApplication, settings: Settings, folder: Path, camera: Camera) -> None:
    """As at the very first start, and what is said where nothing has been measured."""
    fresh = Settings(folder=str(folder / "none"), language=settings.language)
    window = OperatorWindow(fresh, folder / "first.toml")
    window.show()
    for name in ("bench", "geometry", "record", "results", "gap", "compare", "log"):
        window.go(name)
        camera.take(window, f"first-{name}")
    window.ask("start")
    camera.take(window, "first-start")
    window.close()
    window.deleteLater()
    application.sendPostedEvents(None, QEvent.Type.DeferredDelete)


def _in_a_run(application: QApplication, settings: Settings, folder: Path, camera: Camera) -> None:
    """The Record page while the second run goes on."""
    rig = settings.rig.model_copy(update={"fast": False, "display": "window"})
    live = settings.model_copy(update={"rig": rig, "folder": str(folder)})
    window = OperatorWindow(live, folder.with_suffix(".toml"))
    window.show()
    manual_pictures.into_the_second_run(application, window, camera.wait, second_s=120.0)
    camera.take(window, "recording")
    manual_pictures.leave(application, window, camera.wait)


def participants() -> Iterator[tuple[str, ParticipantWindow]]:
    """Whatever the participant can be shown."""
    screen, now = Screen("screen-1", 509.2, 286.4, 1920, 1080), time.monotonic()
    circle = Circle(200, 143, 50, 100)
    touch = translate("Calibration", "Touch the cross and lift: {k} of {n}").format(k=4, n=9)
    words = touch + "\n" + translate("Calibration", "The stylus slid: rest it on the cross without moving.")

    def lost(window: ParticipantWindow) -> None:
        window.show_target(circle, now - 20)
        window.set_contact(True)
        window.set_contact(False)

    def over(window: ParticipantWindow) -> None:
        window.show_target(circle, now - 20)
        window.hide_target()

    def practice(window: ParticipantWindow) -> None:
        window.set_practice(True)
        window.show_target(circle, now + 2.5)

    states: dict[str, Callable[[ParticipantWindow], object]] = {
        "begin": lambda window: window.show_target(circle, now + 2.5),
        "practice": practice,
        "running": lambda window: window.show_target(circle, now - 20),
        "lost": lost,
        "done": over,
        "rest": lambda window: window.set_prompt("Rest"),
        "clocks": lambda window: window.set_prompt("Comparing clocks: leave the screen alone"),
        "tap": lambda window: window.show_target(Tap(254.6, 143.2, 100, 1.0), now),
        "calibration": lambda window: window.show_cross(51, 143, words),
    }
    for name, prepare in states.items():
        window = ParticipantWindow(screen, lambda: now)  # all of one moment
        window.show()
        prepare(window)
        yield name, window
