"""Help: the operator's manual and the list of keys, made from the table of actions."""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication
from PySide6.QtGui import QTextBlockFormat, QTextCursor, QTextDocument
from PySide6.QtWidgets import QHBoxLayout, QTextBrowser, QWidget

from draglag_app.windows.actions import key_list, other_keys
from draglag_app.windows.wording.i18n import language_of
from draglag_app.windows.workspace import Workspace
from draglag_resources import resource


class HelpPage(QWidget):
    """The manual on the left, the keys on the right."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        row = QHBoxLayout(self)
        row.setContentsMargins(16, 16, 16, 16)
        row.setSpacing(12)
        self.manual = QTextBrowser()
        self.manual.setOpenExternalLinks(True)
        self.manual.document().setDocumentMargin(18)
        self.keys = QTextBrowser()
        self.manual.setAccessibleName(self.tr("Help"))
        self.keys.setAccessibleName(self.tr("Keys"))
        self.keys.setFixedWidth(340)
        self.keys.document().setDocumentMargin(14)
        row.addWidget(self.manual, 1)
        row.addWidget(self.keys)
        self.setFocusProxy(self.manual)
        self.restyle_plots()

    def restyle_plots(self) -> None:
        """Set the text anew, in the present theme."""
        self.manual.setMarkdown(manual_text(language_of(self._space.settings.language)))
        _give_air(self.manual.document())
        rows = "".join(
            f"<tr><td style='padding:5px 14px 5px 0'><b>{keys}</b></td><td style='padding:5px 0'>{what}</td></tr>"
            for keys, what in (*key_list(), *other_keys())
        )
        title = self.tr("Keys")
        self.keys.setHtml(f"<h3>{title}</h3><table cellspacing='0'>{rows}</table>")


def _give_air(document: QTextDocument) -> None:
    """Room between paragraphs: Markdown comes without."""
    cursor, block = QTextCursor(document), document.begin()
    while block.isValid():
        shape = block.blockFormat()
        shape.setLineHeight(135, QTextBlockFormat.LineHeightTypes.ProportionalHeight.value)
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
