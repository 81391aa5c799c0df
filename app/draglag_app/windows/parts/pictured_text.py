"""A text with pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from PySide6.QtCore import QPoint
from PySide6.QtGui import QImage, QResizeEvent, QTextCursor, QTextDocument, QTextFragment
from PySide6.QtWidgets import QTextBrowser

PICTURE = "\N{OBJECT REPLACEMENT CHARACTER}"
"""The character of a picture in a text."""
_TOP_PX = 12


class PicturedText(QTextBrowser):
    """Markdown with pictures, of files in ``folder``, as wide as fits."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder = folder

    def show_markdown(self, text: str) -> None:
        """Set the text."""
        self.setMarkdown(text)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Lay out again; the line at the top stays there."""
        top = self.cursorForPosition(QPoint(0, _TOP_PX))
        before_px = self.cursorRect(top).top()
        super().resizeEvent(event)
        self._fit()
        bar = self.verticalScrollBar()
        bar.setValue(bar.value() + self.cursorRect(top).top() - before_px)

    def pictures(self) -> list[tuple[str, float, float]]:
        """(name, width, height) of every picture as shown."""
        formats = (piece.charFormat().toImageFormat() for piece in _pieces(self.document()))
        return [(shape.name(), shape.width(), shape.height()) for shape in formats if shape.isValid()]

    def _fit(self) -> None:
        document = self.document()
        room = self.viewport().width() - 2 * document.documentMargin() - 4
        # All of them first: a fragment is of no use once the text's formats have changed.
        found = [(piece.position(), piece.charFormat().toImageFormat()) for piece in _pieces(document)]
        cursor = QTextCursor(document)
        # One change: of several, Qt lays out the pictures alone and leaves out the words between them.
        cursor.beginEditBlock()
        for position, shape in found:
            file = str(self._folder / shape.name())  # an absolute name, given before, stays itself
            picture = QImage(file) if shape.isValid() else QImage()
            if picture.isNull():
                continue
            width = max(1.0, min(room, float(picture.width())))
            shape.setName(file)
            shape.setWidth(width)
            shape.setHeight(width * picture.height() / picture.width())
            cursor.setPosition(position)
            cursor.setPosition(position + 1, QTextCursor.MoveMode.KeepAnchor)
            cursor.setCharFormat(shape)
        cursor.endEditBlock()
        document.markContentsDirty(0, document.characterCount())


def _pieces(document: QTextDocument) -> Iterator[QTextFragment]:
    block = document.begin()
    while block.isValid():
        pieces = block.begin()
        while not pieces.atEnd():
            yield pieces.fragment()
            pieces += 1
        block = block.next()
