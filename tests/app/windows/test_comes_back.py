"""What the operator asked for once comes by itself: the last session at the next start, a sign at the end of a run."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from draglag_app.windows.main import open_operator_window
from draglag_app.windows.settings import load_settings, save_settings
from draglag_app.windows.window import OperatorWindow

Started = Callable[[Callable[[OperatorWindow], bool]], None]


@pytest.fixture
def started(qapp: QApplication, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Started]:
    """Start the program as the desktop does; it is closed as soon as something is so."""
    monkeypatch.setenv("DRAGLAG_SETTINGS", str(tmp_path / "settings.toml"))
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)  # put back afterwards
    closed: list[OperatorWindow] = []

    def start(so: Callable[[OperatorWindow], bool]) -> None:
        def look() -> None:
            (window,) = (w for w in qapp.topLevelWidgets() if isinstance(w, OperatorWindow) and w not in closed)
            if so(window) and not window.space.tasks.running:
                watch.stop()
                window.close()
                closed.append(window)

        watch = QTimer()
        watch.timeout.connect(look)
        watch.start(20)
        assert open_operator_window() == 0

    yield start
    for window in closed:
        window.deleteLater()


def test_the_last_session_is_reopened_where_that_is_wanted(
    started: Started, session_file: Path, tmp_path: Path
) -> None:
    settings_file, lab = tmp_path / "settings.toml", tmp_path / "lab"
    lab.mkdir()
    last, before = (Path(shutil.copy(session_file, lab / name)) for name in ("last.h5", "before.h5"))
    known, problem = load_settings(settings_file)
    assert not problem
    wanted = {"first_start": False, "folder": str(lab), "recent": (str(last), str(before))}
    shown: list[Path | None] = []

    def on_results(window: OperatorWindow) -> bool:
        done = window.space.analysis is not None and window.page == "results"
        return done and not shown.append(window.space.path)

    save_settings(known.model_copy(update={**wanted, "reopen": True}), settings_file)
    started(on_results)
    last.unlink()  # the one before it then
    started(on_results)
    assert shown == [last, before]

    save_settings(known.model_copy(update={**wanted, "reopen": False}), settings_file)
    started(lambda window: not shown.append(window.space.path))
    assert shown == [last, before, None]


@pytest.mark.parametrize(
    ("settings", "sounds", "flashes"),
    [
        ({}, False, False),
        ({"sound": True}, True, False),
        ({"flash": True}, False, True),
        ({"sound": True, "flash": True, "reduced_motion": True}, True, False),
    ],
    ids=["neither", "sound", "flash", "reduced motion"],
)
def test_a_run_ends_with_sound_and_flash_where_they_are_wanted(
    open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch, settings: dict[str, bool], sounds: bool,
    flashes: bool,
) -> None:  # fmt: skip
    heard: list[int] = []
    monkeypatch.setattr(QApplication, "beep", lambda: heard.append(1))
    window = open_window(**settings)
    run = window.space.protocol.runs[0].model_copy(update={"speeds_mm_s": (240.0, 425.0), "duration_s": 5.0})
    window.space.set_protocol(window.space.protocol.model_copy(update={"runs": (run,), "taps": None}))
    band, seen = window.record.band, []
    window.space.bridge.run_finished.connect(lambda event: seen.append(band.property("flash") == "true"))
    window.ask("start")
    until(lambda: not window.space.recording.active)
    assert len(seen) == 2
    assert len(heard) == (2 if sounds else 0)
    assert seen[-1] is flashes  # after the page has heard of it
    until(lambda: band.property("flash") != "true")  # once, then it is over
