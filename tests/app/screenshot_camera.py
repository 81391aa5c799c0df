"""Takes a picture of a window in both themes on screens of three sizes; a process has one scaling."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QEventLoop, QPoint, QRect, QTimer
from PySide6.QtGui import QPainter, QPixmap
from PySide6.QtWidgets import QApplication, QDialog, QWidget

from draglag_app.windows.parts.theme import THEMES, apply_theme
from draglag_app.windows.window import OperatorWindow

SIZES = ((960, 540), (1280, 800), (1920, 1080))
"""Of screens, in pixels."""
SCALINGS = (100, 150)
"""Pixels to a hundred of the windows' own: what a desktop calls scaling."""

Wait = Callable[..., None]
_TRIES, _EVERY_MS = 200, 100  # on a busy computer a dialog takes its time


def on_screens(folder: Path, scaling: int) -> dict[str, str]:
    """Environment of a process that draws off screen, on one screen of each size."""
    places = [4 * SIZES[-1][0] * k for k in range(len(SIZES))]
    screens = [
        {"name": f"{wide}x{high}", "x": x, "y": 0, "width": wide, "height": high, "logicalDpi": 96}
        for x, (wide, high) in zip(places, SIZES, strict=True)
    ]
    file = folder / "screens.json"
    file.write_text(json.dumps({"screens": screens, "windowFrameMargins": False}), "utf-8")
    # Qt takes what follows a colon for the next setting: a path with one does not reach it.
    drawing = {"QT_QPA_PLATFORM": f"offscreen:configfile={file}", "QT_SCALE_FACTOR": f"{scaling / 100:g}"}
    return {**os.environ, **drawing}


@dataclass(frozen=True)
class Camera:
    """Pictures NAME-THEME-WIDTHxHEIGHT-SCALING.png, in pixels of the screen."""

    out: Path
    scaling: int
    wait: Wait

    def take(self, window: QWidget, name: str, themes: tuple[str, ...] = tuple(THEMES)) -> None:
        """A window."""
        for view in self._views(window, themes):
            self._save(window.grab(), name, view)

    def take_asked(self, window: QWidget, name: str, ask: Callable[[], object]) -> None:
        """A dialog in the middle of its window, as it is when it is asked there."""
        for view in self._views(window, tuple(THEMES)):
            dialog, behind = _asked(ask, name), window.grab()
            ratio = behind.devicePixelRatio()
            room = (behind.size() - dialog.size()) / (2 * ratio)
            painter = QPainter(behind)
            place = QRect(QPoint(room.width(), room.height()), dialog.size() / ratio)
            painter.drawPixmap(place, dialog)
            painter.drawRect(place)  # in place of the frame that a desktop gives it
            painter.end()
            self._save(behind, name, view)

    def _views(self, window: QWidget, themes: tuple[str, ...]) -> Iterator[str]:
        application = QApplication.instance()
        assert isinstance(application, QApplication)
        for theme in themes:
            if isinstance(window, OperatorWindow):
                window.space.change_settings(theme=theme)
                window.use_theme(theme)
            else:
                apply_theme(application, theme)
            for k in range(len(SIZES)):
                screen = application.screens()[k]  # one that a dialog has asked for goes with the dialog, for Python
                name = "-".join((theme, screen.name())) if len(themes) > 1 else screen.name()
                window.setScreen(screen)
                window.setGeometry(screen.geometry())
                self._settle(window)
                yield name

    def _settle(self, window: QWidget) -> None:
        for _ in range(5):
            QApplication.processEvents()
        if isinstance(window, OperatorWindow) and not window.space.recording.active:
            space = window.space
            self.wait(QApplication.instance(), lambda: not space.tasks.running and not space.quiet_tasks.running)

    def _save(self, picture: QPixmap, name: str, view: str) -> None:
        self.out.mkdir(parents=True, exist_ok=True)
        picture.save(str(self.out / f"{name}-{view}-{self.scaling}.png"))


def _asked(ask: Callable[[], object], name: str) -> QPixmap:
    """What a dialog looks like that ``ask`` opens; it is answered with no."""
    waiting, looking = QEventLoop(), QTimer()
    left, found = [_TRIES], list[QPixmap]()

    def answer() -> None:
        box = QApplication.activeModalWidget()
        left[0] -= 1
        if isinstance(box, QDialog):
            found.append(box.grab())
            box.reject()
        if found or not left[0]:
            looking.stop()
            waiting.quit()

    looking.timeout.connect(answer)
    looking.start(_EVERY_MS)
    ask()
    if looking.isActive():
        waiting.exec()  # a dialog that is only shown is answered here
    if not found:
        raise SystemExit(f"nothing was asked for {name}")
    return found[0]
