"""The participant's picture in the operator's window."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QCoreApplication, QRect, Qt
from PySide6.QtGui import QResizeEvent, QScreen
from PySide6.QtWidgets import QVBoxLayout, QWidget

from draglag_app.windows.participant.side_by_side import has_room
from draglag_app.windows.participant.window import ParticipantWindow
from draglag_app.windows.parts.widgets import label

_LEAST_PX = 240


def tr(text: str) -> str:
    return QCoreApplication.translate("Docked", text)


def show_picture(
    picture: ParticipantWindow,
    screen: QScreen | None,
    operator: QWidget | None,
    dock: Callable[[ParticipantWindow], object] | None,
) -> None:
    """Show the picture on that screen; None: next to ``operator``, or given to ``dock`` where it would hide it."""
    visible = operator is not None and operator.isVisible()
    if screen is None and operator is not None and visible and dock and not has_room(operator, picture.ratio):
        dock(picture)
    else:
        picture.show_on(screen, operator)


class DockedPicture(QWidget):
    """The picture, as large as fits."""

    def __init__(self, picture: ParticipantWindow) -> None:
        super().__init__()
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(label(tr("What the participant sees"), "panelTitle"))
        self._room = _Room(picture, picture.ratio)
        column.addWidget(self._room, 1)
        self.setMinimumWidth(_LEAST_PX)
        picture.setAccessibleName(tr("What the participant sees"))
        picture.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        picture.show()


class _Room(QWidget):
    def __init__(self, picture: QWidget, ratio: float) -> None:
        super().__init__()
        self._picture, self._ratio = picture, ratio
        picture.setParent(self)

    def resizeEvent(self, event: QResizeEvent) -> None:
        width = min(self.width(), round(self.height() / self._ratio))
        self._picture.setGeometry(QRect((self.width() - width) // 2, 0, width, round(width * self._ratio)))
