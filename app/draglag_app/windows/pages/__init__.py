"""The operator's pages, one file each. They show and ask; they compute nothing."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from draglag_app.windows.actions import say
from draglag_app.windows.i18n import QT_TRANSLATE_NOOP
from draglag_app.windows.pages.bench import BenchPage
from draglag_app.windows.pages.record import RecordPage
from draglag_app.windows.pages.results import ResultsPage
from draglag_app.windows.workspace import Workspace


def make_pages(workspace: Workspace) -> dict[str, tuple[str, QWidget]]:
    """Name → (title, page), in the order of the work."""
    return {
        "bench": (say(QT_TRANSLATE_NOOP("Actions", "Bench")), BenchPage(workspace)),
        "record": (say(QT_TRANSLATE_NOOP("Actions", "Record")), RecordPage(workspace)),
        "results": (say(QT_TRANSLATE_NOOP("Actions", "Results")), ResultsPage(workspace)),
    }
