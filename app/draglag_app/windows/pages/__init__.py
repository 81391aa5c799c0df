"""The operator's pages."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

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

_PAGES: dict[str, tuple[str, Callable[[Workspace], QWidget]]] = {
    "bench": (QT_TRANSLATE_NOOP("Actions", "Bench"), BenchPage),
    "geometry": (QT_TRANSLATE_NOOP("Actions", "Geometry"), GeometryPage),
    "protocol": (QT_TRANSLATE_NOOP("Actions", "Protocol"), ProtocolPage),
    "record": (QT_TRANSLATE_NOOP("Actions", "Record"), RecordPage),
    "results": (QT_TRANSLATE_NOOP("Actions", "Results"), ResultsPage),
    "gap": (QT_TRANSLATE_NOOP("Actions", "Gap"), GapPage),
    "compare": (QT_TRANSLATE_NOOP("Actions", "Compare"), ComparePage),
    "log": (QT_TRANSLATE_NOOP("Actions", "Log"), LogPage),
    "preferences": (QT_TRANSLATE_NOOP("Actions", "Preferences"), PreferencesPage),
    "help": (QT_TRANSLATE_NOOP("Actions", "Help"), HelpPage),
}


class Pages(Mapping[str, tuple[str, QWidget]]):
    """Name → (title, page), in the order of the work.

    A page is made when it is first asked for, and handed to ``take``: with all of them, the window opens late.
    """

    def __init__(self, workspace: Workspace, take: Callable[[QWidget], object]) -> None:
        self._space = workspace
        self._take = take
        self.titles = {name: say(title) for name, (title, _) in _PAGES.items()}
        self.made: dict[str, QWidget] = {}

    def __getitem__(self, name: str) -> tuple[str, QWidget]:
        if name not in self.made:
            page = self.made[name] = _PAGES[name][1](self._space)
            self._take(page)
        return self.titles[name], self.made[name]

    def make_all(self) -> None:
        """Make those that nobody asked for yet."""
        for _ in self.values():
            pass

    def __contains__(self, name: object) -> bool:
        return name in _PAGES  # Mapping's own would make the page

    def __iter__(self) -> Iterator[str]:
        return iter(_PAGES)

    def __len__(self) -> int:
        return len(_PAGES)
