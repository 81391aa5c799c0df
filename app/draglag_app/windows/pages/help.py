"""Help: the manual and the keys."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QCoreApplication, Qt
from PySide6.QtGui import QFocusEvent, QTextBlockFormat, QTextCursor, QTextDocument
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QTextBrowser,
    QVBoxLayout,
    QWidget,
)

from draglag_app.windows.actions import key_list, other_keys
from draglag_app.windows.parts.columns import Columns
from draglag_app.windows.parts.pictured_text import PICTURE, PicturedText
from draglag_app.windows.parts.theme import wide
from draglag_app.windows.parts.widgets import restyle
from draglag_app.windows.workspace import Workspace
from draglag_resources import resource

_CONTENTS_PX, _MANUAL_PX, _KEYS_PX = 210, 300, 320
_LEAST_PX = 330  # height of the manual, and of the keys where they stand below it
_ABOVE_PX = 8  # room above the section that was asked for


class HelpPage(QWidget):
    """Contents, search, manual, keys."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        outer = QVBoxLayout(self)
        outer.setContentsMargins(16, 16, 16, 16)
        columns = Columns(12)
        outer.addLayout(columns, 1)
        reading = QWidget()
        row = QHBoxLayout(reading)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(12)
        left = QVBoxLayout()
        self.search = QLineEdit()
        self.search.setPlaceholderText(self.tr("Search"))
        self.search.setAccessibleName(self.tr("Search"))
        self.search.setClearButtonEnabled(True)
        self.search.textEdited.connect(lambda text: self.look_for(text, again=False))
        self.search.returnPressed.connect(lambda: self.look_for(self.search.text(), again=True))
        self.contents = QListWidget()
        self.contents.setAccessibleName(self.tr("Contents"))
        self.contents.setWordWrap(True)
        # Always there: an entry is wrapped for the width that it has before the bar comes.
        self.contents.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOn)
        self.contents.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.contents.currentItemChanged.connect(lambda item, before: self._section_chosen(item))
        left.addWidget(self.search)
        left.addWidget(self.contents, 1)
        self.manual = PicturedText(Path(str(resource("manual", ""))))
        self.manual.setOpenExternalLinks(True)
        self.manual.document().setDocumentMargin(18)
        self.manual.setMinimumWidth(wide(_MANUAL_PX))
        self.keys = QTextBrowser()
        self.manual.setAccessibleName(self.tr("Help"))
        self.keys.setAccessibleName(self.tr("Keys"))
        self.keys.document().setDocumentMargin(14)
        for part in (self.search, self.contents):
            part.setFixedWidth(wide(_CONTENTS_PX))
        row.addLayout(left)
        row.addWidget(self.manual, 1)
        reading.setMinimumHeight(_LEAST_PX)
        self.keys.setMinimumSize(_KEYS_PX, _LEAST_PX)
        columns.add_column(reading, 1)
        columns.add_column(self.keys, 0)
        self.restyle_plots()

    def focusInEvent(self, event: QFocusEvent) -> None:
        """Focus the manual; with a focus proxy, Tab would skip what precedes it."""
        self.manual.setFocus(event.reason())

    def restyle_plots(self) -> None:
        """Draw in the present theme."""
        self.manual.show_markdown(manual_text(self._space.language))
        _give_air(self.manual.document())
        self.contents.blockSignals(True)
        self.contents.clear()
        self.contents.addItems([title for title, _ in sections(self.manual.document())])
        self.contents.blockSignals(False)
        self.show_keys()

    def _section_chosen(self, item: QListWidgetItem | None) -> None:
        if item is not None:
            self.show_section(item.text())

    def show_keys(self) -> None:
        """List the present keys."""
        rows = "".join(
            f"<tr><td style='padding:5px 14px 5px 0'><b>{keys}</b></td><td style='padding:5px 0'>{what}</td></tr>"
            for keys, what in (*key_list(self._space.settings.keys), *other_keys())
        )
        title = self.tr("Keys")
        self.keys.setHtml(f"<h3>{title}</h3><table cellspacing='0'>{rows}</table>")

    def show_section(self, title: str) -> None:
        """Scroll to that section, if any."""
        for known, position in sections(self.manual.document()):
            if known == title:
                cursor = QTextCursor(self.manual.document())
                cursor.movePosition(QTextCursor.MoveOperation.End)
                self.manual.setTextCursor(cursor)  # from the end back: the section comes to the top
                cursor.setPosition(position)
                self.manual.setTextCursor(cursor)
                top = self.manual.cursorRect(cursor).top()
                bar = self.manual.verticalScrollBar()
                bar.setValue(bar.value() + top - _ABOVE_PX)

    def look_for(self, text: str, again: bool) -> bool:
        """Whether the text occurs; goes to its next place, after the last to the first."""
        cursor = self.manual.textCursor()
        if not again:
            cursor.setPosition(cursor.selectionStart())
            self.manual.setTextCursor(cursor)
        if not text:
            return False
        found = self.manual.find(text)
        if not found:
            self.manual.moveCursor(QTextCursor.MoveOperation.Start)
            found = self.manual.find(text)
        restyle(self.search, "fault", "false" if found else "true")
        return found


def sections(document: QTextDocument) -> list[tuple[str, int]]:
    """(title, position) of every section."""
    found, block = [], document.begin()
    while block.isValid():
        if block.blockFormat().headingLevel() == 2:
            found.append((block.text(), block.position()))
        block = block.next()
    return found


def _give_air(document: QTextDocument) -> None:
    cursor, block = QTextCursor(document), document.begin()
    while block.isValid():
        shape = block.blockFormat()
        pictured = PICTURE in block.text()
        shape.setLineHeight(100 if pictured else 135, QTextBlockFormat.LineHeightTypes.ProportionalHeight.value)
        shape.setTopMargin(22 if shape.headingLevel() else 2)
        shape.setBottomMargin(8)
        cursor.setPosition(block.position())
        cursor.setBlockFormat(shape)
        block = block.next()


def manual_text(language: str) -> str:
    """The manual in that language, or in English."""
    for name in (f"manual_{language}.md", "manual.md"):
        file = resource("manual", name)
        if file.is_file():
            return file.read_text("utf-8")
    return QCoreApplication.translate("Help", "The manual is missing from this installation.")
