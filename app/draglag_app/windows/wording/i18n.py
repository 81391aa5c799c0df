"""Translations, English text → translation, whatever the context."""

from __future__ import annotations

import locale
import tomllib
from collections.abc import Mapping

from PySide6.QtCore import QCoreApplication, QLibraryInfo, QObject, QTranslator

from draglag_resources import resource


def QT_TRANSLATE_NOOP(context: str, text: str) -> str:
    """Mark a text for translation; Qt's own is typed as object."""
    return text


def translate(context: str, text: str) -> str:
    """The text in the operator's language."""
    return QCoreApplication.translate(context, text)


class TableTranslator(QTranslator):
    """Translates by a table; other texts stay English."""

    def __init__(self, table: Mapping[str, str], parent: QObject | None = None, others: QTranslator | None = None):
        super().__init__(parent)
        self._table = table
        self._others = others

    def isEmpty(self) -> bool:
        return not self._table

    def translate(self, context: str, sourceText: str, disambiguation: str | None = None, n: int = -1) -> str:
        # Not an empty text: from Python that counts as a translation, and Qt's own words would vanish.
        known = self._table.get(sourceText)
        if known is None and self._others is not None:
            known = self._others.translate(context, sourceText, disambiguation, n)
        return known or sourceText


def language_of(setting: str) -> str:
    """A setting's language; English without a translation."""
    if setting == "system":
        setting = (locale.getlocale()[0] or "en")[:2]
    return setting if resource("translations", f"{setting}.toml").is_file() else "en"


def table_of(language: str) -> dict[str, str]:
    """English text → translation; empty for English."""
    file = resource("translations", f"{language}.toml")
    if not file.is_file():
        return {}
    return {str(key): str(value) for key, value in tomllib.loads(file.read_text("utf-8")).items()}


def use_language(application: QCoreApplication, setting: str) -> None:
    """Set the language of texts shown later."""
    for old in application.findChildren(TableTranslator):
        application.removeTranslator(old)
        old.deleteLater()
    language = language_of(setting)
    table = table_of(language)
    if table:
        dialogs = QTranslator()  # Qt's own words: those of file dialogs, of menus in fields
        dialogs.load(f"qtbase_{language}", QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath))
        application.installTranslator(TableTranslator(table, application, dialogs))
