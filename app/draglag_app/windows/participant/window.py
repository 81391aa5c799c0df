"""What the participant sees."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from PySide6.QtCore import QCoreApplication, QEvent, QPointF, QRect, QRectF, Qt, QTimer, Signal
from PySide6.QtGui import (
    QCloseEvent,
    QColor,
    QFont,
    QFontMetricsF,
    QKeyEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QRegion,
    QScreen,
)
from PySide6.QtWidgets import QWidget

from draglag.protocol.targets import Tap, Target
from draglag.recording import Screen
from draglag_app.windows.participant.frame_log import FrameLog
from draglag_app.windows.participant.full_screen import FullScreen
from draglag_app.windows.participant.side_by_side import WIDE_PX, place_side_by_side
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP
from draglag_app.windows.wording.library_words import in_words

BACKGROUND, TARGET, PRACTICE, INK = "#0e1116", "#56b4e9", "#e69f00", "#f2f5f8"
TARGET_MM = 14.0
DONE = QT_TRANSLATE_NOOP("Participant", "Done. Lift the stylus.")
SESSION_PROMPTS = (
    QT_TRANSLATE_NOOP("Participant", "Rest"),
    QT_TRANSLATE_NOOP("Participant", "Comparing clocks: leave the screen alone"),
)
"""Prompts of the session itself."""
# Of the width: as far as words may reach.
_WORDS_WIDE = 0.96
# So long the target moves before a stylus that is not there is asked for.
_LATE_S = 1.0
_GESTURES = frozenset((QEvent.Type.TouchBegin, QEvent.Type.TouchUpdate, QEvent.Type.TouchEnd, QEvent.Type.TouchCancel,
                       QEvent.Type.Gesture, QEvent.Type.NativeGesture))  # fmt: skip


class ParticipantWindow(QWidget):
    """Draws the target on a fixed grid of frames.

    Positions are mm on the screen under test, which the window represents: true to size at full screen.
    """

    aborted = Signal()
    """The participant pressed Esc."""
    closing = Signal()
    """The window was asked to close during a session."""
    stepped_back = Signal()
    """Backspace: the last target of a calibration again."""

    def __init__(
        self, screen: Screen, clock: Callable[[], float] = time.monotonic, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent, Qt.WindowType.Window)
        self.setWindowTitle(QCoreApplication.translate("Participant", "draglag – participant"))
        # Touches must arrive as such, or the platform turns them into mouse events and gestures.
        self.setAttribute(Qt.WidgetAttribute.WA_AcceptTouchEvents)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setAttribute(Qt.WidgetAttribute.WA_NoSystemBackground)
        self.setCursor(Qt.CursorShape.BlankCursor)
        self._screen = screen
        self._clock = clock
        self._full_screen = FullScreen(self)
        self.frames = FrameLog()
        self._target: Target | None = None
        self._cross: tuple[float, float] | None = None
        self._start_s = 0.0
        self._prompt = ""
        self._practice = False
        self._contact_lost = False
        self._words = ""
        self._dirty = QRect()
        self._slot = -1
        self._rate_hz = 60.0
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._tick)

    # --- what to show ---------------------------------------------------------------------------------------

    @property
    def ratio(self) -> float:
        """Height over width of the screen under test."""
        return self._screen.height_mm / self._screen.width_mm

    def show_on(self, screen: QScreen | None, operator: QWidget | None = None) -> None:
        """Fill that screen; None: a window next to ``operator``."""
        if screen is None:
            if operator is not None and operator.isVisible():
                place_side_by_side(self, operator, self.ratio)
                return
            self.resize(WIDE_PX, round(WIDE_PX * self.ratio))
            self.show()
            return
        self._rate_hz = screen.refreshRate() if screen.refreshRate() >= 30 else 60.0
        self._full_screen.fill(screen)

    def show_target(self, target: Target, start_s: float) -> None:
        """Show the target; it moves from ``start_s`` on."""
        self.frames.clear()
        self._target, self._start_s, self._slot, self._cross = target, start_s, -1, None
        self._refresh()
        self._tick()

    def hide_target(self) -> None:
        self._timer.stop()
        self._target = None
        self._prompt = DONE
        self._refresh()

    def show_cross(self, x_mm: float, y_mm: float, words: str) -> None:
        """Show a cross to be touched, and ``words``."""
        self._timer.stop()
        self._target, self._cross, self._prompt = None, (x_mm, y_mm), words
        self._refresh()

    def set_prompt(self, text: str) -> None:
        self._prompt = text
        self._refresh()

    def set_practice(self, practice: bool) -> None:
        """Mark the run as practice."""
        self._practice = practice
        self._refresh()

    def set_contact(self, touching: bool) -> None:
        """Set whether the stylus is on the screen."""
        if self._contact_lost == touching:
            self._contact_lost = not touching
            self._refresh()

    # --- time -----------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        if self._target is None:
            return
        words = self._present_words()
        if words != self._words:
            self._refresh()
        else:
            x, y = self._place_px(self._elapsed_s())
            self.repaint(QRegion(self._dirty).united(QRegion(self._around(x, y))))
        now_s = self._clock() - self._start_s
        next_s = (math.floor(now_s * self._rate_hz) + 1) / self._rate_hz
        self._timer.start(max(0, math.ceil(1e3 * (next_s - now_s))))

    def next_frame_s(self) -> float:
        """Time to the next frame; 0 where nothing moves."""
        return max(0.0, 1e-3 * self._timer.remainingTime()) if self._timer.isActive() else 0.0

    def _elapsed_s(self) -> float:
        if self._target is None:
            return 0.0
        return min(max(0.0, self._clock() - self._start_s), self._target.duration_s)

    def _log_frame(self, t_s: float, x_mm: float, y_mm: float) -> None:
        if self._target is None or t_s < self._start_s or t_s > self._start_s + self._target.duration_s:
            return
        slot = math.floor((t_s - self._start_s) * self._rate_hz)
        missed = max(0, slot - self._slot - 1) if self._slot >= 0 else 0
        self._slot = slot
        self.frames.add(t_s, x_mm, y_mm, missed)

    # --- drawing --------------------------------------------------------------------------------------------

    def _refresh(self) -> None:
        self._words = self._present_words()
        self.update()

    def _px_per_mm(self) -> tuple[float, float]:
        return self.width() / self._screen.width_mm, self.height() / self._screen.height_mm

    def _place_px(self, elapsed_s: float) -> tuple[float, float]:
        if self._target is None:
            return 0.0, 0.0
        x_mm, y_mm = self._target.position_mm(elapsed_s)
        across, down = self._px_per_mm()
        return float(x_mm) * across, float(y_mm) * down

    def _radius_px(self) -> tuple[float, float]:
        across, down = self._px_per_mm()
        return TARGET_MM / 2 * across, TARGET_MM / 2 * down

    def _around(self, x_px: float, y_px: float) -> QRect:
        a, b = self._radius_px()
        return QRectF(x_px - a - 8, y_px - b - 8, 2 * a + 16, 2 * b + 16).toAlignedRect()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(event.rect(), QColor(BACKGROUND))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._words:
            self._paint_words(painter)
        if self._cross is not None:
            self._paint_cross(painter, *self._cross)
        if self._target is None:
            return
        t_s = self._clock()
        elapsed_s = min(max(0.0, t_s - self._start_s), self._target.duration_s)
        x_mm, y_mm = (float(v) for v in self._target.position_mm(elapsed_s))
        across, down = self._px_per_mm()
        centre = QPointF(x_mm * across, y_mm * down)
        a, b = self._radius_px()
        colour = QColor(PRACTICE if self._practice else TARGET)
        painter.setPen(QPen(colour, max(2.0, a / 7), Qt.PenStyle.DashLine if self._practice else Qt.PenStyle.SolidLine))
        painter.drawEllipse(centre, a, b)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(colour)
        painter.drawEllipse(centre, a / 3, b / 3)
        painter.end()
        self._dirty = self._around(centre.x(), centre.y())
        self._log_frame(t_s, x_mm, y_mm)

    def _paint_cross(self, painter: QPainter, x_mm: float, y_mm: float) -> None:
        across, down = self._px_per_mm()
        centre = QPointF(x_mm * across, y_mm * down)
        a, b = self._radius_px()
        painter.setPen(QPen(QColor(TARGET), max(1.0, a / 14)))
        painter.drawLine(centre - QPointF(a, 0), centre + QPointF(a, 0))
        painter.drawLine(centre - QPointF(0, b), centre + QPointF(0, b))
        painter.drawEllipse(centre, a / 2, b / 2)

    def _paint_words(self, painter: QPainter) -> None:
        big, _, small = self._words.partition("\n")
        height = self.height()
        painter.setPen(QColor(PRACTICE if self._practice else INK))
        # Between the rows of crosses, which stand at 0.1, 0.5 and 0.9 of the height.
        places = ((big, 0.055, 0.22), (small, 0.04, 0.32)) if self._cross else ((big, 0.055, 0.05), (small, 0.1, 0.13))
        below = 0.0  # the words above
        for text, share, top in places:
            font = QFont(self.font())
            font.setPixelSize(max(14, round(share * height)))
            # Upright screens and long languages: as large as the width allows.
            wide = QFontMetricsF(font).horizontalAdvance(text)
            fits = min(1.0, _WORDS_WIDE * self.width() / max(wide, 1.0))
            font.setPixelSize(max(8, int(font.pixelSize() * fits)))
            painter.setFont(font)
            # In a small picture letters are not as small as the share of it.
            area = QRectF(0, max(top * height, below), self.width(), QFontMetricsF(font).height())
            below = area.bottom()
            painter.drawText(area, Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop, text)

    def _present_words(self) -> str:
        say = QCoreApplication.translate
        if self._target is None:
            return in_words(self._prompt)
        practice = say("Participant", "Practice. ") if self._practice else ""
        before_s = self._start_s - self._clock()
        if isinstance(self._target, Tap):
            return practice + say("Participant", "Tap the spot {n} times").format(n=self._target.count)
        if before_s > 0:
            begin = say("Participant", "Touch the circle to begin")
            return f"{practice}{begin}\n{math.ceil(before_s)}"
        if self._contact_lost and before_s < -_LATE_S:
            return practice + say("Participant", "Contact lost: put the stylus back on the circle")
        if before_s > -3:
            return practice + say("Participant", "Keep the circle under the stylus")
        return practice.strip()

    # --- the participant's hands ----------------------------------------------------------------------------

    def event(self, event: QEvent) -> bool:
        if event.type() in _GESTURES:
            event.accept()
            return True
        return super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            self.aborted.emit()
        elif event.key() == Qt.Key.Key_Backspace:
            self.stepped_back.emit()
        event.accept()

    def closeEvent(self, event: QCloseEvent) -> None:
        # Alt+F4 in the participant's hands ends the run, never the program.
        if event.spontaneous():
            self.closing.emit()
            event.ignore()
            return
        self._timer.stop()
        event.accept()
