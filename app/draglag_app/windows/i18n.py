"""Texts to be translated. The names are those that lupdate looks for."""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication


def QT_TRANSLATE_NOOP(context: str, text: str) -> str:
    """Mark a text for translation; it is translated where it is shown. (Qt's own is typed as returning object.)"""
    return text


def translate(context: str, text: str) -> str:
    """The text in the operator's language."""
    return QCoreApplication.translate(context, text)
