"""A bar of known length."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QScreen
from PySide6.QtWidgets import QWidget

from draglag.recording import Screen

BAR_MM = 100.0


class RulerWindow(QWidget):
    """Full screen; any key or touch closes it."""

    def __init__(self, panel: Screen, screen: QScreen) -> None:
        super().__init__(None, Qt.WindowType.Window)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._panel = panel
        self.setScreen(screen)
        self.setGeometry(screen.geometry())
        self.showFullScreen()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor("#0e1116"))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        length = BAR_MM * self.width() / self._panel.width_mm
        left, middle = (self.width() - length) / 2, self.height() / 2
        painter.setPen(QPen(QColor("#f2f5f8"), 2))
        painter.drawLine(QPointF(left, middle), QPointF(left + length, middle))
        for k in range(11):
            x = left + k * length / 10
            painter.drawLine(QPointF(x, middle), QPointF(x, middle - (40 if k % 5 == 0 else 22)))
        font = self.font()
        font.setPixelSize(max(14, round(0.022 * self.height())))
        painter.setFont(font)
        text = self.tr("{mm:.0f} mm — Esc closes").format(mm=BAR_MM)
        below = QRectF(0, middle + 20, self.width(), 3 * font.pixelSize())
        painter.drawText(below, Qt.AlignmentFlag.AlignHCenter, text)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        self.close()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.close()
