"""The operator's pages."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from draglag_app.windows.actions import say
from draglag_app.windows.pages.bench import BenchPage
from draglag_app.windows.pages.compare import ComparePage
from draglag_app.windows.pages.gap import GapPage
from draglag_app.windows.pages.geometry import GeometryPage
from draglag_app.windows.pages.help import HelpPage
from draglag_app.windows.pages.log import LogPage
from draglag_app.windows.pages.preferences import PreferencesPage
from draglag_app.windows.pages.protocol import ProtocolPage
from draglag_app.windows.pages.record import RecordPage
from draglag_app.windows.pages.results import ResultsPage
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP
from draglag_app.windows.workspace import Workspace


def make_pages(workspace: Workspace) -> dict[str, tuple[str, QWidget]]:
    """Name → (title, page), in the order of the work."""
    pages: dict[str, tuple[str, QWidget]] = {
        "bench": (QT_TRANSLATE_NOOP("Actions", "Bench"), BenchPage(workspace)),
        "geometry": (QT_TRANSLATE_NOOP("Actions", "Geometry"), GeometryPage(workspace)),
        "protocol": (QT_TRANSLATE_NOOP("Actions", "Protocol"), ProtocolPage(workspace)),
        "record": (QT_TRANSLATE_NOOP("Actions", "Record"), RecordPage(workspace)),
        "results": (QT_TRANSLATE_NOOP("Actions", "Results"), ResultsPage(workspace)),
        "gap": (QT_TRANSLATE_NOOP("Actions", "Gap"), GapPage(workspace)),
        "compare": (QT_TRANSLATE_NOOP("Actions", "Compare"), ComparePage(workspace)),
        "log": (QT_TRANSLATE_NOOP("Actions", "Log"), LogPage(workspace)),
        "preferences": (QT_TRANSLATE_NOOP("Actions", "Preferences"), PreferencesPage(workspace)),
        "help": (QT_TRANSLATE_NOOP("Actions", "Help"), HelpPage(workspace)),
    }
    return {name: (say(title), page) for name, (title, page) in pages.items()}
