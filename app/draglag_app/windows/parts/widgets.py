"""Small parts of all pages."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QEvent, QObject, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPaintEvent, QPen, QPolygonF, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QFormLayout,
    QFrame,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QLayout,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QTableWidget,
    QVBoxLayout,
    QWidget,
)

from draglag_app.windows.parts.follow_focus import FollowFocus
from draglag_app.windows.parts.full_texts import WholeTexts
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.parts.theme import theme, wide

# Rows are chosen by finger too.
ROW_PX = 44
# Per cent: with text larger than this, small screens are too narrow for things that otherwise stand side by side.
LARGE_TEXT = 120
# In a narrow window columns are scrolled to rather than leave no room for the one that takes what is left.
_LEAST_COLUMN_PX = 60
_ARROWS = (Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_Home, Qt.Key.Key_End)


class Panel(QFrame):
    """A box; ``body`` holds its content."""

    def __init__(self, title: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("panel")
        outer = QVBoxLayout(self)
        outer.setContentsMargins(12, 10, 12, 12)
        outer.setSpacing(8)
        self.top = QHBoxLayout()
        self.title = label(title, "panelTitle")
        self.title.setParent(self)
        self.title.setVisible(bool(title))
        if title:
            self.top.addWidget(self.title)
            self.top.addStretch(1)
            outer.addLayout(self.top)
        self.body = QVBoxLayout()
        self.body.setSpacing(8)
        outer.addLayout(self.body, 1)


class Form(QFormLayout):
    """Rows of label and field."""

    def __init__(self) -> None:
        super().__init__()
        self.setVerticalSpacing(4)
        self.setHorizontalSpacing(16)
        if wide(100) > LARGE_TEXT:
            self.setRowWrapPolicy(QFormLayout.RowWrapPolicy.WrapLongRows)
        self.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)

    def row(self, text: str, field: QWidget | QLayout) -> None:
        """Add a row."""
        name = label(text)
        name.setMinimumHeight(44)
        if isinstance(field, QWidget):
            name.setBuddy(field)
            field.setAccessibleName(text)
        self.addRow(name, field)


class Light(QWidget):
    """A device's state.

    ○ "off" · ● "ready" · ● with a ring "live" · ▲ "warning" · ■ with a cross "fault".
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.state = "off"
        self.setFixedSize(22, 22)

    def sizeHint(self) -> QSize:
        return QSize(22, 22)

    def set_state(self, state: str) -> None:
        self.state = state
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        colours = theme()
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        box = QRectF(3, 3, 16, 16)
        if self.state == "off":
            painter.setPen(QPen(QColor(colours.muted), 2))
            painter.drawEllipse(box.adjusted(2, 2, -2, -2))
        elif self.state in ("ready", "live"):
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(colours.ok))
            painter.drawEllipse(box.adjusted(3, 3, -3, -3) if self.state == "live" else box.adjusted(2, 2, -2, -2))
            if self.state == "live":
                painter.setBrush(Qt.BrushStyle.NoBrush)
                painter.setPen(QPen(QColor(colours.ok), 2))
                painter.drawEllipse(box)
        elif self.state == "warning":
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(colours.warning))
            painter.drawPolygon(QPolygonF([QPointF(11, 2), QPointF(20, 19), QPointF(2, 19)]))
        else:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(colours.bad))
            painter.drawRect(box)
            painter.setPen(QPen(QColor(colours.panel), 2.5))
            painter.drawLine(QPointF(7, 7), QPointF(15, 15))
            painter.drawLine(QPointF(15, 7), QPointF(7, 15))


def label(text: str = "", name: str = "", wrap: bool = False) -> QLabel:
    """Plain text; ``name``: its look in the style sheet."""
    made = QLabel()
    made.setTextFormat(Qt.TextFormat.PlainText)
    made.setText(text)
    if name:
        made.setObjectName(name)
    made.setWordWrap(wrap)
    if wrap:
        made.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
    return made


def button(text: str, role: str = "", large: bool = False, tip: str = "") -> QPushButton:
    """A push button; ``role``: "primary", "danger" or none."""
    made = QPushButton(text)
    if role:
        made.setProperty("role", role)
    made.setProperty("large", "true" if large else "false")
    made.setToolTip(plain(tip))
    made.setAutoDefault(False)
    return made


def table(titles: Sequence[str], stretch: int = 0, single: bool = True) -> QTableWidget:
    """A table of rows, as ``set_up_table``."""
    made = QTableWidget()
    set_up_table(made, titles, stretch, single)
    return made


def set_up_table(made: QTableWidget, titles: Sequence[str], stretch: int = 0, single: bool = True) -> None:
    """Set titles, stretching column and selection; read-only; Tab leaves it."""
    made.setColumnCount(len(titles))
    made.setHorizontalHeaderLabels(list(titles))
    made.verticalHeader().hide()
    made.verticalHeader().setDefaultSectionSize(ROW_PX)
    made.setShowGrid(False)
    made.setTabKeyNavigation(False)
    made.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    made.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    if single:
        made.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        made.installEventFilter(FirstRow(made))
    made.setItemDelegate(WholeTexts(made))
    header = made.horizontalHeader()
    header.setTextElideMode(Qt.TextElideMode.ElideRight)
    header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
    header.setMinimumSectionSize(wide(_LEAST_COLUMN_PX))
    header.setSectionResizeMode(stretch, QHeaderView.ResizeMode.Stretch)


class FirstRow(QObject):
    """Without a selection, an arrow key selects the current row; Qt goes on to the next."""

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        made = self.parent()
        if not isinstance(event, QKeyEvent) or event.type() != QEvent.Type.KeyPress or event.key() not in _ARROWS:
            return False
        if not isinstance(made, QTableWidget) or not made.rowCount() or made.selectionModel().hasSelection():
            return False
        made.selectRow(max(0, made.currentRow()))
        return True


class Scrolled(QScrollArea):
    """A column that scrolls, and follows the focus."""

    def __init__(self, column: QLayout) -> None:
        super().__init__()
        self._inside = QWidget()
        column.setContentsMargins(0, 0, 0, 0)
        self._inside.setLayout(column)
        self.setWidget(self._inside)
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setMinimumHeight(120)
        FollowFocus(self)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        # As wide as what is in it, with room for the bar where there is one.
        self.setMinimumWidth(self._inside.minimumSizeHint().width() + self.verticalScrollBar().sizeHint().width())

    def sizeHint(self) -> QSize:
        return self._inside.sizeHint()

    def whole_height(self, width: int) -> int:
        """The height at which nothing scrolls."""
        layout = self._inside.layout()
        if layout is not None and layout.hasHeightForWidth():
            return max(layout.totalHeightForWidth(width), self._inside.minimumSizeHint().height())
        return self._inside.minimumSizeHint().height()


class Shallow(QScrollArea):
    """A label as high as its text, up to ``most_px``, then scrolled."""

    def __init__(self, inside: QLabel, most_px: int) -> None:
        super().__init__()
        self._most_px = most_px
        # Else its hint, which knows no width, would be its least height.
        inside.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.setWidget(inside)
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._fit()

    def show_text(self, text: str) -> None:
        """Show another text."""
        inside = self.widget()
        if isinstance(inside, QLabel):
            inside.setText(text)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        inside = self.widget()
        if isinstance(inside, QLabel):
            text = inside.heightForWidth(self.viewport().width()) if inside.text() else 0
            self.setFixedHeight(min(text, self._most_px))
            # A keyboard scrolls it too, where there is something to scroll.
            self.setFocusPolicy(Qt.FocusPolicy.TabFocus if text > self._most_px else Qt.FocusPolicy.NoFocus)


class Resting:
    """Disables buttons during their work; the focus returns afterwards."""

    def __init__(self, *buttons: QPushButton) -> None:
        self._buttons = buttons
        self._pressed: QPushButton | None = None
        self._fell_to: QWidget | None = None

    def rest(self) -> None:
        self._pressed = next((one for one in self._buttons if one.hasFocus()), self._pressed)
        for one in self._buttons:
            one.setEnabled(False)
        self._fell_to = QApplication.focusWidget()

    def give_focus_back(self) -> None:
        """Return the focus; call after enabling the buttons."""
        pressed, self._pressed = self._pressed, None
        if pressed is not None and pressed.isEnabled() and QApplication.focusWidget() is self._fell_to:
            pressed.setFocus(Qt.FocusReason.TabFocusReason)


def restyle(widget: QWidget, name: str, value: str) -> None:
    """Change a property that the style sheet uses."""
    widget.setProperty(name, value)
    widget.style().unpolish(widget)
    widget.style().polish(widget)


class Fact(QWidget):
    """A number with its name."""

    def __init__(self, title: str) -> None:
        super().__init__()
        box = QVBoxLayout(self)
        box.setContentsMargins(0, 0, 0, 0)
        box.setSpacing(0)
        self.title = label(title, "hint")
        self.value = label("–", "figure")
        box.addWidget(self.title)
        box.addWidget(self.value)

    def show_text(self, text: str) -> None:
        self.value.setText(text)
