"""Texts that come from files, devices and people are shown as they are written: markup in them is never obeyed."""

from __future__ import annotations

from html import escape

from PySide6.QtGui import Qt


def plain(text: str) -> str:
    """The text for a place in which Qt guesses whether it is markup: tooltips, message boxes. It is shown as it is."""
    if not Qt.mightBeRichText(text):
        return text
    return "<span>" + escape(text).replace("\n", "<br>") + "</span>"
