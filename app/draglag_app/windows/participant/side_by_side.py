"""The participant's window next to the operator's."""

from __future__ import annotations

from PySide6.QtCore import QObject, QPoint, QRect, QSize
from PySide6.QtWidgets import QWidget

# The participant's window is as wide as this where there is room; next to the operator's it may be narrower.
WIDE_PX, _LEAST_PX = 960, 400
_GAP_PX = 8
# Over the operator's window, where there is no room next to it, the display is this share of the screen's width.
_SHARE = 0.4


def places(screen: QRect, operator: QRect, ratio: float) -> tuple[QRect, QPoint]:
    """Place of the participant's window, corner of the operator's, with frames.

    ``ratio``: height over width. Without room, the participant's is small, in the lower right corner.
    """
    for corner in (operator.topLeft(), QPoint(screen.left(), operator.top()), QPoint(operator.left(), screen.top())):
        moved = QRect(corner, operator.size())
        rooms = (
            screen.adjusted(moved.right() + 1 + _GAP_PX - screen.left(), 0, 0, 0),
            screen.adjusted(0, 0, moved.left() - _GAP_PX - screen.right() - 1, 0),
            screen.adjusted(0, moved.bottom() + 1 + _GAP_PX - screen.top(), 0, 0),
            screen.adjusted(0, 0, 0, moved.top() - _GAP_PX - screen.bottom() - 1),
        )
        room, size = max(((room, _fit(room.size(), ratio)) for room in rooms), key=lambda pair: pair[1].width())
        if size.width() >= _LEAST_PX:
            top = min(max(moved.top(), room.top()), room.bottom() + 1 - size.height())
            return QRect(QPoint(room.left(), top), size), corner
    size = _fit(screen.size() * _SHARE, ratio)
    return QRect(screen.bottomRight() + QPoint(1, 1) - QPoint(size.width(), size.height()), size), operator.topLeft()


def has_room(operator: QWidget, ratio: float) -> bool:
    """Whether nothing of the operator's window would be hidden."""
    screen, frame = operator.screen().availableGeometry(), operator.frameGeometry()
    place, corner = places(screen, frame, ratio)
    return not place.intersects(QRect(corner, frame.size()))


def _fit(room: QSize, ratio: float) -> QSize:
    width = min(WIDE_PX, room.width(), round(room.height() / ratio))
    return QSize(max(0, width), max(0, round(width * ratio)))


def place_side_by_side(participant: QWidget, operator: QWidget, ratio: float) -> None:
    """Show the participant's window next to the operator's."""
    screen = operator.screen().availableGeometry()
    place, corner = places(screen, operator.frameGeometry(), ratio)
    if corner != operator.pos() and not (operator.isMaximized() or operator.isFullScreen()):
        operator.move(corner)
    # The frame is not there before the window is: the operator's is as thick.
    bar = operator.geometry().topLeft() - operator.frameGeometry().topLeft()
    participant.setGeometry(place.adjusted(bar.x(), bar.y(), -bar.x(), -bar.x()))
    participant.show()


def operators_window(known: QObject) -> QWidget | None:
    """The window that owns this object, or None."""
    owner: QObject | None = known
    while owner is not None and not isinstance(owner, QWidget):
        owner = owner.parent()
    return owner.window() if owner is not None else None
