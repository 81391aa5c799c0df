"""The operator's actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from PySide6.QtCore import QCoreApplication, QObject
from PySide6.QtGui import QAction, QKeySequence, QUndoStack
from PySide6.QtWidgets import QMenuBar, QWidget

from draglag_app.windows.parts.letter_menu import LetterMenu
from draglag_app.windows.parts.recent_menu import RecentMenu
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP

CONTEXT = "Actions"


@dataclass(frozen=True)
class ActionSpec:
    """An action; ``when``: "always", "idle" or "recording"."""

    id: str
    menu: str
    text: str
    keys: str = ""
    when: str = "always"


MENUS = {
    "session": QT_TRANSLATE_NOOP("Actions", "&Session"),
    "edit": QT_TRANSLATE_NOOP("Actions", "&Edit"),
    "measure": QT_TRANSLATE_NOOP("Actions", "&Measure"),
    "go": QT_TRANSLATE_NOOP("Actions", "&Go to"),
    "help": QT_TRANSLATE_NOOP("Actions", "&Help"),
}
ACTIONS = (
    ActionSpec("open", "session", QT_TRANSLATE_NOOP("Actions", "Open session…"), "Ctrl+O", "idle"),
    ActionSpec("import", "session", QT_TRANSLATE_NOOP("Actions", "Import exchange folder…"), "Ctrl+I", "idle"),
    ActionSpec("export", "session", QT_TRANSLATE_NOOP("Actions", "Export session…"), "Ctrl+E", "idle"),
    ActionSpec("csv", "session", QT_TRANSLATE_NOOP("Actions", "Export tables (CSV)…"), "Ctrl+Shift+C", "idle"),
    ActionSpec("netcdf", "session", QT_TRANSLATE_NOOP("Actions", "Export netCDF…"), "Ctrl+Shift+N", "idle"),
    ActionSpec("mat", "session", QT_TRANSLATE_NOOP("Actions", "Export MATLAB…"), "Ctrl+Shift+M", "idle"),
    ActionSpec("figures", "session", QT_TRANSLATE_NOOP("Actions", "Export figures…"), "Ctrl+Shift+F", "idle"),
    ActionSpec("report", "session", QT_TRANSLATE_NOOP("Actions", "Write report…"), "Ctrl+Shift+E", "idle"),
    ActionSpec("gap_report", "session", QT_TRANSLATE_NOOP("Actions", "Write gap report…"), "Ctrl+Shift+G", "idle"),
    ActionSpec("details", "session", QT_TRANSLATE_NOOP("Actions", "Session details…"), "Ctrl+D", "idle"),
    ActionSpec("quit", "session", QT_TRANSLATE_NOOP("Actions", "Quit"), "Ctrl+Q"),
    ActionSpec("undo", "edit", QT_TRANSLATE_NOOP("Actions", "Undo"), "Ctrl+Z"),
    ActionSpec("redo", "edit", QT_TRANSLATE_NOOP("Actions", "Redo"), "Ctrl+Shift+Z"),
    ActionSpec("start", "measure", QT_TRANSLATE_NOOP("Actions", "Start measuring"), "F5", "idle"),
    ActionSpec("proceed", "measure", QT_TRANSLATE_NOOP("Actions", "Begin next run now"), "F6", "recording"),
    ActionSpec("repeat", "measure", QT_TRANSLATE_NOOP("Actions", "Repeat this run"), "F7", "recording"),
    ActionSpec("abort", "measure", QT_TRANSLATE_NOOP("Actions", "Abort this run"), "F8", "recording"),
    ActionSpec("stop", "measure", QT_TRANSLATE_NOOP("Actions", "Stop and save"), "F9", "recording"),
    ActionSpec("note", "measure", QT_TRANSLATE_NOOP("Actions", "Write a note"), "F4", "recording"),
    ActionSpec("check", "measure", QT_TRANSLATE_NOOP("Actions", "Check the rig"), "F3", "idle"),
    ActionSpec("calibrate", "measure", QT_TRANSLATE_NOOP("Actions", "Calibrate the touchscreen"), "Ctrl+K", "idle"),
    ActionSpec("analyse", "measure", QT_TRANSLATE_NOOP("Actions", "Analyse again"), "F2", "idle"),
    ActionSpec("cancel", "measure", QT_TRANSLATE_NOOP("Actions", "Cancel what is running"), "Ctrl+."),
    ActionSpec("go_bench", "go", QT_TRANSLATE_NOOP("Actions", "Bench"), "Ctrl+1"),
    ActionSpec("go_geometry", "go", QT_TRANSLATE_NOOP("Actions", "Geometry"), "Ctrl+2"),
    ActionSpec("go_protocol", "go", QT_TRANSLATE_NOOP("Actions", "Protocol"), "Ctrl+3"),
    ActionSpec("go_record", "go", QT_TRANSLATE_NOOP("Actions", "Record"), "Ctrl+4"),
    ActionSpec("go_results", "go", QT_TRANSLATE_NOOP("Actions", "Results"), "Ctrl+5"),
    ActionSpec("go_gap", "go", QT_TRANSLATE_NOOP("Actions", "Gap"), "Ctrl+6"),
    ActionSpec("go_compare", "go", QT_TRANSLATE_NOOP("Actions", "Compare"), "Ctrl+7"),
    ActionSpec("go_log", "go", QT_TRANSLATE_NOOP("Actions", "Log"), "Ctrl+8"),
    ActionSpec("go_preferences", "go", QT_TRANSLATE_NOOP("Actions", "Preferences"), "Ctrl+9"),
    ActionSpec("go_help", "go", QT_TRANSLATE_NOOP("Actions", "Help"), "F1"),
    ActionSpec("help_here", "help", QT_TRANSLATE_NOOP("Actions", "The manual on this page"), "Shift+F1"),
    ActionSpec("theme", "help", QT_TRANSLATE_NOOP("Actions", "Dark or light"), "Ctrl+T"),
    ActionSpec("fullscreen", "help", QT_TRANSLATE_NOOP("Actions", "Full screen"), "F11"),
)

ELSEWHERE = (
    ("Esc", QT_TRANSLATE_NOOP("Actions", "on the participant's screen: abort this run, or the calibration")),
    (
        QT_TRANSLATE_NOOP("Actions", "Backspace"),
        QT_TRANSLATE_NOOP("Actions", "on the participant's screen: one calibration target back"),
    ),
    (
        QT_TRANSLATE_NOOP("Actions", "Tab"),
        QT_TRANSLATE_NOOP("Actions", "next field or button; with Shift back"),
    ),
    (QT_TRANSLATE_NOOP("Actions", "Space"), QT_TRANSLATE_NOOP("Actions", "press the button, tick the box")),
    (QT_TRANSLATE_NOOP("Actions", "Return"), QT_TRANSLATE_NOOP("Actions", "on a plot: copy or save it")),
    (
        QT_TRANSLATE_NOOP("Actions", "Letters"),
        QT_TRANSLATE_NOOP("Actions", "in a menu or a box: the entry that begins so"),
    ),
    (QT_TRANSLATE_NOOP("Actions", "Alt+letter"), QT_TRANSLATE_NOOP("Actions", "open a menu, by its underlined letter")),
)
"""Keys that belong to no action."""


def say(text: str) -> str:
    """A text of this table, translated."""
    return QCoreApplication.translate(CONTEXT, text)


class Actions(QObject):
    """The table as QActions; those without a handler are left out."""

    def __init__(self, parent: QObject, handlers: Mapping[str, Callable[[], object]]) -> None:
        super().__init__(parent)
        self.made: dict[str, QAction] = {}
        for spec in ACTIONS:
            handler = handlers.get(spec.id)
            if handler is None:
                continue
            action = QAction(say(spec.text), self)
            action.setShortcut(QKeySequence(spec.keys))
            action.triggered.connect(_without_argument(handler))
            self.made[spec.id] = action

    def use_keys(self, chosen: Mapping[str, str]) -> None:
        """Give actions these keys, others the usual ones."""
        for name, action in self.made.items():
            action.setShortcut(QKeySequence(keys_of(name, chosen)))

    def fill(self, bar: QMenuBar) -> None:
        """Add the menus."""
        for name, title in MENUS.items():
            menu = LetterMenu(say(title), bar)
            bar.addMenu(menu)
            for spec in ACTIONS:
                if spec.menu == name and spec.id in self.made:
                    menu.addAction(self.made[spec.id])

    def add_recent(self, bar: QMenuBar, recent: RecentMenu) -> None:
        """Add recent sessions below *Open session…*."""
        first = bar.findChild(LetterMenu)
        if first is not None:
            first.insertMenu(first.actions()[1], recent)

    def serve(self, window: QWidget) -> None:
        """Make keys of measuring and pages work there."""
        window.addActions([self.made[s.id] for s in ACTIONS if s.id in self.made and s.menu in ("measure", "go")])

    def run_keys(self) -> list[QAction]:
        """Actions of a run."""
        return [self.made[s.id] for s in ACTIONS if s.id in self.made and s.when == "recording"]

    def follow(self, stack: QUndoStack) -> None:
        """Show what can be undone and redone."""
        for name, able, able_now, what, what_now in (
            ("undo", stack.canUndoChanged, stack.canUndo(), stack.undoTextChanged, stack.undoText()),
            ("redo", stack.canRedoChanged, stack.canRedo(), stack.redoTextChanged, stack.redoText()),
        ):
            action = self.made[name]
            renamed = partial(_name_after, action, action.text())
            able.connect(action.setEnabled)
            what.connect(renamed)
            action.setEnabled(able_now)
            renamed(what_now)

    def set_recording(self, recording: bool) -> None:
        """Enable the state's actions."""
        for spec in ACTIONS:
            if spec.id in self.made and spec.when != "always":
                self.made[spec.id].setEnabled((spec.when == "recording") == recording)


def _name_after(action: QAction, text: str, what: str) -> None:
    action.setText(f"{text}: {what}" if what else text)


def _without_argument(handler: Callable[[], object]) -> Callable[[], None]:
    def call() -> None:
        handler()

    return call


def key_list(chosen: Mapping[str, str]) -> list[tuple[str, str]]:
    """(keys, meaning) of every action that has keys."""
    rows = [(keys_of(spec.id, chosen), say(spec.text)) for spec in ACTIONS]
    return [(keys, text) for keys, text in rows if keys]


def keys_of(action: str, chosen: Mapping[str, str]) -> str:
    """An action's keys; empty if none."""
    usual = next((spec.keys for spec in ACTIONS if spec.id == action), "")
    return QKeySequence(chosen.get(action, usual)).toString()


def who_has(keys: str, chosen: Mapping[str, str]) -> str:
    """The action with these keys; empty if none."""
    return next((spec.id for spec in ACTIONS if keys and keys_of(spec.id, chosen) == keys), "")


def other_keys() -> list[tuple[str, str]]:
    """(keys, meaning) of those without an action."""
    return [(say(keys), say(what)) for keys, what in ELSEWHERE]
