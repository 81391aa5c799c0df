"""Texts cut off, whole in the tooltip."""

from __future__ import annotations

from PySide6.QtCore import QAbstractItemModel, QModelIndex, QPersistentModelIndex, Qt
from PySide6.QtGui import QFontMetrics, QHelpEvent, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QLabel,
    QPushButton,
    QSizePolicy,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionButton,
    QStyleOptionComboBox,
    QStyleOptionViewItem,
    QStylePainter,
    QToolTip,
)

from draglag_app.windows.parts.plain import plain

# Left and right of an entry in a list that drops down.
_MARGINS_PX = 24


class ElidedLabel(QLabel):
    """One line that never widens the window; ``text()`` is whole."""

    def __init__(self, name: str = "") -> None:
        super().__init__()
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setObjectName(name)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def setText(self, text: str) -> None:
        super().setText(text)
        self._tell_whole()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._tell_whole()

    def shown(self) -> str:
        """The text as shown."""
        return elided(self.fontMetrics(), self.text(), self.contentsRect().width())

    def paintEvent(self, event: QPaintEvent) -> None:
        place, align = self.contentsRect(), int(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.style().drawItemText(
            QPainter(self), place, align, self.palette(), self.isEnabled(), self.shown(), self.foregroundRole()
        )

    def _tell_whole(self) -> None:
        tip = self.text() if self.shown() != self.text() else ""
        if plain(tip) != self.toolTip():
            self.setToolTip(plain(tip))


class ElidedBox(QComboBox):
    """A choice whose text ends in dots where the box is narrower; as wide as so many letters."""

    def __init__(self, letters: int) -> None:
        super().__init__()
        self.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.setMinimumContentsLength(letters)

    def whole_px(self) -> int:
        """The width at which every choice is whole."""
        self.ensurePolished()
        letters = self.fontMetrics()
        least_px = self.minimumContentsLength() * letters.horizontalAdvance("X")
        longest_px = max((letters.horizontalAdvance(self.itemText(k)) for k in range(self.count())), default=0)
        return self.sizeHint().width() + max(0, longest_px - least_px)

    def shown(self) -> str:
        """The choice as shown."""
        option = QStyleOptionComboBox()
        self.initStyleOption(option)
        control, part = QStyle.ComplexControl.CC_ComboBox, QStyle.SubControl.SC_ComboBoxEditField
        room = self.style().subControlRect(control, option, part, self).width()
        return elided(self.fontMetrics(), self.currentText(), room)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, option = QStylePainter(self), QStyleOptionComboBox()
        self.initStyleOption(option)
        option.currentText = self.shown()
        painter.drawComplexControl(QStyle.ComplexControl.CC_ComboBox, option)
        painter.drawControl(QStyle.ControlElement.CE_ComboBoxLabel, option)


def elided(letters: QFontMetrics, text: str, room_px: int) -> str:
    """As much of a text as fits."""
    return letters.elidedText(text, Qt.TextElideMode.ElideRight, room_px)


class ElidedButton(QPushButton):
    """A button whose text ends in dots where there is no room; ``text()`` is whole."""

    def shown(self) -> str:
        """The text as shown."""
        option = QStyleOptionButton()
        self.initStyleOption(option)
        room = self.style().subElementRect(QStyle.SubElement.SE_PushButtonContents, option, self).width()
        return elided(self.fontMetrics(), self.text(), room)

    def paintEvent(self, event: QPaintEvent) -> None:
        option = QStyleOptionButton()
        self.initStyleOption(option)
        option.text = self.shown()
        QStylePainter(self).drawControl(QStyle.ControlElement.CE_PushButton, option)


class WholeTexts(QStyledItemDelegate):
    """Shows cut-off cells' texts as tooltips."""

    def helpEvent(
        self,
        event: QHelpEvent,
        view: QAbstractItemView,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> bool:
        own = index.data(Qt.ItemDataRole.ToolTipRole)
        if not own and self.is_cut_off(view, option, index):
            QToolTip.showText(event.globalPos(), plain(str(index.data() or "")), view)
            return True
        return super().helpEvent(event, view, option, index)

    def is_cut_off(
        self, view: QAbstractItemView, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> bool:
        """Whether the cell is narrower than its text."""
        model: QAbstractItemModel | None = view.model()
        return model is not None and self.sizeHint(option, index).width() > option.rect.width()


def whole_text(box: QComboBox, tip: str = "") -> None:
    """Show the choice as tooltip, and widen the list."""

    def show_tip(text: str) -> None:
        box.setToolTip(plain(": ".join(part for part in (tip, text) if part)))

    box.currentTextChanged.connect(show_tip)
    show_tip(box.currentText())
    widen_list(box)


def widen_list(box: QComboBox) -> None:
    """Widen the list to its longest entry so far."""
    letters = box.fontMetrics()
    widest = max((letters.horizontalAdvance(box.itemText(k)) for k in range(box.count())), default=0)
    box.view().setMinimumWidth(widest + box.view().verticalScrollBar().sizeHint().width() + _MARGINS_PX)
