"""The state on Record, and buttons."""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication, QEvent, QObject, QTimer, Signal
from PySide6.QtGui import QFont, QFontMetrics
from PySide6.QtWidgets import QHBoxLayout, QProgressBar, QWidget

from draglag_app.windows.parts.full_texts import ElidedLabel
from draglag_app.windows.parts.heading import Heading
from draglag_app.windows.parts.theme import theme, wide
from draglag_app.windows.parts.widgets import Panel, button, restyle

# Room for the largest letters; buttons give way to it.
_BIG_PX = 260
# The largest letters, read across a room, and those of a line that is longer than some letters.
_BIG_LETTERS_PX, _LONG_LETTERS_PX, _FEW = 40, 26, 18
# Long enough to be seen from the corner of the eye, once.
_FLASH_MS = 400
# Buttons of the time before a session; the others are of the session itself.
_IDLE = ("start", "mend")


def tr(text: str) -> str:
    return QCoreApplication.translate("StateBand", text)


class StateBand(Panel):
    """Two lines, and buttons that emit ``pressed(action id)``."""

    pressed = Signal(str)
    said = Signal(str, str)
    """The two lines of a new state."""

    def __init__(self) -> None:
        super().__init__()
        self._letters_px = 0  # of the largest line
        self._flash = QTimer(self)
        self._flash.setSingleShot(True)
        self._flash.setInterval(_FLASH_MS)
        self._flash.timeout.connect(lambda: restyle(self, "flash", "false"))
        side, row = plain_row()
        row.addStretch(1)
        self.big = ElidedLabel("big")
        self.big.installEventFilter(self)
        self.small = ElidedLabel("medium")
        self.buttons = {}
        for action, text, role in (
            ("mend", "", "primary"),
            ("start", tr("Start  F5"), "primary"),
            ("proceed", tr("Begin now  F6"), "primary"),
            ("repeat", tr("Repeat run  F7"), ""),
            ("abort", tr("Abort run  F8"), "danger"),
            ("stop", tr("Stop and save  F9"), "danger"),
        ):
            made = button(text, role, large=True)
            made.clicked.connect(lambda checked=False, action=action: self.pressed.emit(action))
            self.buttons[action] = made
            row.addWidget(made)
        self.progress = QProgressBar()
        self.progress.setTextVisible(False)
        self.progress.setRange(0, 1000)
        under, below = plain_row()
        below.addWidget(self.small, 3)
        below.addWidget(self.progress, 1)
        self.heading = Heading(self.big, side, under, wide(_BIG_PX))
        self.body.addWidget(self.heading)

    def set_recording(self, recording: bool) -> None:
        """Show the buttons of the state."""
        visible = {made: (action in _IDLE) != recording for action, made in self.buttons.items()}
        for made in sorted(visible, key=lambda made: visible[made]):  # hidden first: all at once widen the window
            made.setVisible(visible[made])
        self.progress.setVisible(recording)
        if not recording:
            self.progress.setValue(0)

    def show_mend(self, text: str) -> None:
        """Show the button to the first obstacle, if any."""
        self.buttons["mend"].setVisible(bool(text))
        self.buttons["mend"].setText(text)

    def enable(self, resting: bool, running: bool, any_run: bool) -> None:
        """Enable what can be asked for now."""
        self.buttons["proceed"].setEnabled(resting)
        self.buttons["abort"].setEnabled(running)
        # What makes no sense now gives its room to the largest letters.
        for made, visible in ((self.buttons["proceed"], not running), (self.buttons["abort"], running)):
            made.setVisible(visible)
        self.buttons["repeat"].setEnabled(running or any_run)
        self.progress.setVisible(running)  # of a run alone: a rest needs the room for its words

    def say(self, big: str, small: str, level: str = "") -> None:
        """Show two lines; ``level``: "live", "good", "warning", "bad"."""
        before = self.big.text(), self.small.text()
        for line, text in ((self.big, big), (self.small, small)):
            if line.text() != text:
                line.setText(text)
        if before != (big, small):
            self.said.emit(big, small)
        same = level == self.big.property("level") and self._fitting_px() == self._letters_px
        if not same:  # it is set ten times a second; the colour stays
            restyle(self.big, "level", level)
            self.restyle()

    def restyle(self) -> None:
        """Draw in the present theme."""
        colours = {"live": theme().bad, "bad": theme().bad, "good": theme().ok, "warning": theme().warning}
        colour = colours.get(str(self.big.property("level") or ""), theme().text)
        self._letters_px = self._fitting_px()
        self.big.setStyleSheet(f"color: {colour}; font-size: {self._letters_px}px;")

    def _fitting_px(self) -> int:
        """The largest letters, if the line is short enough for them and for its room."""
        text, large_px, small_px = self.big.text(), wide(_BIG_LETTERS_PX), wide(_LONG_LETTERS_PX)
        font = QFont(self.big.font())
        font.setPixelSize(large_px)
        fits = QFontMetrics(font).horizontalAdvance(text) <= self.big.contentsRect().width()
        return large_px if len(text) <= _FEW and fits else small_px

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize and self._fitting_px() != self._letters_px:
            self.restyle()
        return super().eventFilter(watched, event)

    def show_share(self, share: float) -> None:
        """Show the fraction of a run done."""
        self.progress.setValue(5 * round(200 * share))

    def flash(self) -> None:
        """Flash once."""
        restyle(self, "flash", "true")
        self._flash.start()


def plain_row() -> tuple[QWidget, QHBoxLayout]:
    """A widget without margins, and its row."""
    made = QWidget()
    row = QHBoxLayout(made)
    row.setContentsMargins(0, 0, 0, 0)
    row.setSpacing(8)
    return made, row
