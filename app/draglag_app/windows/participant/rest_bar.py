"""The operator's controls on a shared monitor."""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication, QEvent, QObject, Qt, Signal
from PySide6.QtWidgets import QFrame, QLineEdit, QVBoxLayout, QWidget

from draglag_app.windows.parts.flow import Flow
from draglag_app.windows.parts.full_texts import ElidedLabel
from draglag_app.windows.parts.theme import wide
from draglag_app.windows.parts.widgets import button, label

_NOTE_PX = 320


def tr(text: str) -> str:
    return QCoreApplication.translate("RestBar", text)


class RestBar(QFrame):
    """State, note and buttons, hidden while a target is shown.

    ``noted(text)``: a note. ``pressed(action id)``: "proceed" or "go_record".
    """

    noted = Signal(str)
    pressed = Signal(str)

    def __init__(self, display: QWidget) -> None:
        super().__init__(display)
        self.setObjectName("panel")
        self.setCursor(Qt.CursorShape.ArrowCursor)
        # The display takes touches as such; here they press buttons.
        self.setAttribute(Qt.WidgetAttribute.WA_NoMousePropagation)
        body = QVBoxLayout(self)
        self.state = ElidedLabel("medium")
        self.note = QLineEdit()
        self.note.setMinimumWidth(wide(_NOTE_PX))
        title = label(tr("Note"))
        title.setBuddy(self.note)
        self.note.setAccessibleName(tr("Note"))
        self.note.returnPressed.connect(self._write)
        self.keep = button(tr("Keep note"))
        self.keep.clicked.connect(self._write)
        row = Flow(10)
        row.addWidget(title)
        row.add_growing(self.note)
        row.addWidget(self.keep)
        row.add_rest()
        for action, text in (("go_record", tr("Operator's window")), ("proceed", tr("Begin next run now"))):
            made = button(text)
            made.clicked.connect(lambda checked=False, action=action: self.pressed.emit(action))
            row.addWidget(made)
        body.addWidget(self.state)
        body.addLayout(row)
        self._display, self._body = display, body
        display.installEventFilter(self)
        self.hide()

    def say(self, big: str, small: str) -> None:
        """Show the Record page's state."""
        self.state.setText(" · ".join(part for part in (big, small) if part))

    def offer(self) -> None:
        """Show the bar."""
        self._stand_below()
        self.show()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize:
            self._stand_below()
        return super().eventFilter(watched, event)

    def _stand_below(self) -> None:
        size = self._display.size()
        height = max(self._body.totalHeightForWidth(size.width()), self.sizeHint().height())
        self.setGeometry(0, size.height() - height, size.width(), height)

    def _write(self) -> None:
        text = self.note.text().strip()
        if text:
            self.noted.emit(text)
            self.note.clear()
