"""The operator's window."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QByteArray, Qt
from PySide6.QtGui import QCloseEvent, QKeyEvent, QResizeEvent
from PySide6.QtWidgets import (
    QApplication,
    QHBoxLayout,
    QMainWindow,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from draglag_app.session import events
from draglag_app.windows import exports, files
from draglag_app.windows.actions import Actions
from draglag_app.windows.another_place import ask_another_place, withdraw
from draglag_app.windows.beginning import begin
from draglag_app.windows.drops import Drops
from draglag_app.windows.header import Header
from draglag_app.windows.keyboard import Keyboard
from draglag_app.windows.leaving import sure_to_stop
from draglag_app.windows.navigation import Navigation
from draglag_app.windows.notice import NoticeStrip
from draglag_app.windows.one_monitor import OneMonitor
from draglag_app.windows.pages import Pages
from draglag_app.windows.pages.bench import BenchPage
from draglag_app.windows.pages.geometry import GeometryPage
from draglag_app.windows.pages.help import HelpPage
from draglag_app.windows.pages.preferences import PreferencesPage
from draglag_app.windows.pages.record import RecordPage
from draglag_app.windows.parts.file_dialogs import close_file_dialogs
from draglag_app.windows.parts.page_stack import ColumnScroll, PageScroll, PageStack
from draglag_app.windows.parts.recent_menu import RecentMenu
from draglag_app.windows.parts.theme import apply_theme, theme, wide
from draglag_app.windows.ready import make_ready, show_chosen_keys
from draglag_app.windows.session_dialog import SessionDialog
from draglag_app.windows.settings import Settings
from draglag_app.windows.start import obstacles
from draglag_app.windows.steps import STEPS, StepGuide, steps_of
from draglag_app.windows.titles import figure_source, window_title
from draglag_app.windows.wording.check_words import Checked
from draglag_app.windows.wording.library_words import fault_words, in_words, source_name
from draglag_app.windows.workspace import Workspace

# A window narrower than that, with letters of the usual size, shows the pages' icons without their titles.
_NARROW_PX = 1100


class OperatorWindow(QMainWindow):
    """Header, navigation, pages, notices."""

    def __init__(self, settings: Settings, settings_file: Path) -> None:
        super().__init__()
        self.setWindowTitle("draglag")
        self.resize(1280, 800)
        self.space = Workspace(settings, settings_file, self)
        self._keys: dict[str, str] = {}
        self.pages = Pages(self.space, self._take_page)
        self.keyboard = Keyboard(self)
        self.actions_table = Actions(self, self._handlers())
        self.run_keys = self.actions_table.run_keys
        self.actions_table.fill(self.menuBar())
        self.recent = RecentMenu(self.menuBar(), lambda: self.space.settings.recent, self.open_file)
        self.actions_table.add_recent(self.menuBar(), self.recent)
        self.actions_table.follow(self.space.undo)
        self._fill_frame()
        make_ready(self, self._keys)
        Drops(self)
        self._make_first_pages()
        recording, bridge = self.space.recording, self.space.bridge
        recording.began.connect(lambda order: self._recording_changed(True))
        recording.ended.connect(self._ended)
        bridge.notice_raised.connect(self._notice)
        bridge.place_wanted.connect(lambda event: ask_another_place(self, self.space.recording.control, event))
        bridge.device_fault.connect(lambda fault: self.notify("error", fault_words(fault.problem, fault.remedy)))
        self.space.noticed.connect(self.notify)
        self.space.saved.connect(self.notice.saved)
        self.header.lights_changed.connect(self._show_readiness)
        self.space.settings_changed.connect(self._use_keys)
        self._use_keys()
        self.one_monitor = OneMonitor(self)
        for changed in (self.space.settings_changed, self.space.protocol_changed):
            changed.connect(self.record.forget_outcome)
            changed.connect(self._show_readiness)
        self.space.session_changed.connect(self._show_title)
        self._recording_changed(False)
        self.go("bench" if settings.first_start else "record")

    # --- the frame ------------------------------------------------------------------------------------------

    def _fill_frame(self) -> None:
        # From the outside in: with a style sheet each new parent styles everything below it again.
        middle = QWidget()
        self.setCentralWidget(middle)
        outer = QVBoxLayout(middle)
        outer.setContentsMargins(0, 0, 0, 0)
        outer.setSpacing(0)
        # Before the rest: Tab goes from the page, which may be made last of all, to the notice, then to the header.
        self.notice = NoticeStrip(self.space.tasks, middle)
        self.notice_text = self.notice.text
        self.header = Header(self.space)
        outer.addWidget(self.header)
        self.header.help.clicked.connect(lambda: self.ask("help_here"))
        self.steps = StepGuide()
        self.steps.chosen.connect(self.go)
        outer.addWidget(self.steps)
        row = QHBoxLayout()
        outer.addLayout(row, 1)
        row.setSpacing(0)
        self.navigation = Navigation(self.pages.titles, self.actions_table.made)
        self.navigation.chosen.connect(self.go)
        row.addWidget(ColumnScroll(self.navigation))
        self.stack = PageStack()
        row.addWidget(PageScroll(self.stack), 1)
        outer.addWidget(self.notice)
        self.notice.raise_()  # what reads the window to the operator goes from top to bottom

    def _make_first_pages(self) -> None:
        """Those that miss something if they come later: a check of the rig, a recording, notices."""
        (_, bench), (_, record), _ = (self.pages[name] for name in ("bench", "record", "log"))
        assert isinstance(bench, BenchPage)
        assert isinstance(record, RecordPage)
        self.bench, self.record = bench, record
        bench.checked.connect(self._checked)
        record.asks.connect(self.ask)
        record.noted.connect(self.keyboard.give_back)

    def _take_page(self, page: QWidget) -> None:
        self.stack.addWidget(page)
        make_ready(page, self._keys)
        if isinstance(page, PreferencesPage):
            page.theme_chosen.connect(self.use_theme)

    @property
    def geometry_page(self) -> GeometryPage:
        """The page Geometry."""
        _, page = self.pages["geometry"]
        assert isinstance(page, GeometryPage)
        return page

    # --- asking ---------------------------------------------------------------------------------------------

    def _handlers(self) -> dict[str, Callable[[], object]]:
        space = self.space
        handlers: dict[str, Callable[[], object]] = {
            "open": lambda: files.open_session(self),
            "import": lambda: files.import_folder(self),
            "export": lambda: files.export_session(self),
            "csv": lambda: exports.export_as(self, "csv"),
            "netcdf": lambda: exports.export_as(self, "netcdf"),
            "mat": lambda: exports.export_as(self, "mat"),
            "figures": lambda: exports.export_figures(self),
            "report": lambda: files.write_report(self),
            "gap_report": lambda: exports.export_gap_report(self),
            "quit": self.close,
            "undo": self._undo,
            "redo": self._redo,
            "details": self.ask_details,
            "help_here": self.help_here,
            "start": lambda: self.start(),
            "proceed": lambda: self._control("proceed"),
            "repeat": self._repeat,
            "abort": lambda: self._control("abort_run"),
            "stop": lambda: self._control("stop"),
            "note": self.keyboard.note,
            "check": self._check,
            "calibrate": self._calibrate,
            "analyse": space.analyse,
            "cancel": self._cancel,
            "theme": self._other_theme,
            "fullscreen": self._full_screen,
        }
        for name in self.pages:
            handlers[f"go_{name}"] = partial(self.keyboard.come_to, name)
        return handlers

    def _undo(self) -> None:
        what = self.space.undo.undoText()
        self.space.undo.undo()
        self.notify("info", self.tr("Undone: {what}").format(what=what))

    def _redo(self) -> None:
        what = self.space.undo.redoText()
        self.space.undo.redo()
        self.notify("info", self.tr("Redone: {what}").format(what=what))

    def ask(self, action: str) -> None:
        """Do the action of that id."""
        self.actions_table.made[action].trigger()

    def go(self, name: str) -> None:
        """Show a page."""
        page = self.pages[name][1]
        self.navigation.tabs[name].setChecked(True)
        if self.stack.currentWidget() is page and page.isAncestorOf(self.focusWidget() or self):
            return  # the keyboard stays where it is
        self.notice.forget_done()
        self.stack.setCurrentWidget(page)
        self._show_steps()
        page.setFocus()

    def notify(self, level: str, text: str) -> None:
        """As ``NoticeStrip.notify``."""
        self.notice.notify(level, text)

    def open_file(self, path: Path) -> None:
        """Open a session or exchange folder; not while recording."""
        if self.space.recording.active:
            self.notify("info", self.tr("A session is being recorded: open others when it is done."))
        elif path.is_dir() or path.name == "session.json":
            files.read_folder(self, path if path.is_dir() else path.parent)
        else:
            self.space.open(path, lambda: self.go("results"))

    def restore(self) -> None:
        """Restore size, place and page."""
        settings = self.space.settings
        if settings.geometry:
            self.restoreGeometry(QByteArray.fromBase64(settings.geometry.encode()))
        if settings.page in self.pages and not settings.first_start:
            self.go(settings.page)

    def _remember(self) -> None:
        geometry = self.saveGeometry().toBase64().data()
        text = geometry.decode() if isinstance(geometry, bytes) else ""
        self.space.change_settings(geometry=text, page=self.page)

    def offer_salvage(self) -> None:
        """Offer to save unfinished recordings."""
        files.offer_salvage(self)

    # --- recording ------------------------------------------------------------------------------------------

    def start(self, asked: bool = False) -> None:
        """As ``begin``."""
        begin(self, asked)

    def help_here(self) -> None:
        """Show the manual on the present page."""
        title = self.pages.titles[self.page]
        self.go("help")
        page = self.pages["help"][1]
        assert isinstance(page, HelpPage)
        page.show_section(title)

    def ask_details(self) -> None:
        """Ask for the next session's details."""
        SessionDialog(self.space, self).open()

    def _control(self, request: str) -> None:
        control = self.space.recording.control
        if control is not None:
            getattr(control, request)()

    def _repeat(self) -> None:
        self._control("repeat_run")
        self.record.say_repeat()

    def _check(self) -> None:
        self.go("bench")
        self.bench.check()

    def _calibrate(self) -> None:
        self.go("geometry")
        self.geometry_page.calibration.start()

    def _cancel(self) -> None:
        self.space.tasks.cancel_all()
        self.space.calibrating.cancel()

    def _recording_changed(self, recording: bool) -> None:
        if recording:
            close_file_dialogs(self)  # sessions are opened and exported between measurements
        self.actions_table.set_recording(recording)
        self.keyboard.serve()
        self.one_monitor.begin()
        self.record.set_recording(recording)
        self._show_title()
        self._show_readiness()

    def _show_readiness(self) -> None:
        found, faults = obstacles(self.space), self.header.faults()
        self.record.show_readiness(found, faults)
        self._show_steps()

    def _show_steps(self) -> None:
        page = self.page
        self.steps.setVisible(page in STEPS and not self.space.recording.active)
        if self.steps.isVisibleTo(self):
            self.steps.show_steps(steps_of(obstacles(self.space), self.header.faults()), page)

    @property
    def page(self) -> str:
        """The name of the present page."""
        shown = self.stack.currentWidget()
        return next((name for name, page in self.pages.made.items() if page is shown), "bench")

    def _use_keys(self) -> None:
        chosen = self.space.settings.keys
        if chosen == self._keys:
            return
        self._keys = dict(chosen)
        self.actions_table.use_keys(chosen)
        show_chosen_keys(self, chosen)
        help_page = self.pages.made.get("help")
        if isinstance(help_page, HelpPage):
            help_page.show_keys()

    def figure_source(self) -> str:
        """The source of this window's figures."""
        return figure_source(self.space)

    def _show_title(self) -> None:
        self.setWindowTitle(window_title(self.space))

    def _ended(self, path: Path | None, problem: str) -> None:
        withdraw(self)
        self.record.show_outcome(path, problem)
        self._recording_changed(False)
        if path is not None and not problem:
            self.go("results")
            self.notify("info", self.tr("Saved: {path}").format(path=path))

    def _notice(self, event: events.NoticeRaised) -> None:
        if event.level in ("warning", "error") or event.state:
            self.notify(event.level, f"{source_name(event.source)}: {in_words(event.text)}")

    def _checked(self, results: list[Checked]) -> None:
        for result in results:
            self.header.set_light(result.role, result.state, result.text)

    # --- looks and leaving ----------------------------------------------------------------------------------

    def _other_theme(self) -> None:
        self.space.change_settings(theme="light" if theme().name == "dark" else "dark")
        self.use_theme(self.space.settings.theme)

    def use_theme(self, name: str) -> None:
        """Draw everything in that theme."""
        application = QApplication.instance()
        assert isinstance(application, QApplication)
        apply_theme(application, name)
        self.navigation.paint_icons()
        for page in self.pages.made.values():
            redraw = getattr(page, "restyle_plots", None)
            if redraw is not None:
                redraw()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.navigation.set_narrow(self.width() < wide(_NARROW_PX))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Return presses a focused button; Qt leaves that to the space bar."""
        focus = self.focusWidget()
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and isinstance(focus, QPushButton):
            focus.click()
            return
        super().keyPressEvent(event)

    def _full_screen(self) -> None:
        self.setWindowState(self.windowState() ^ Qt.WindowState.WindowFullScreen)

    def closeEvent(self, event: QCloseEvent) -> None:
        if self.space.recording.active and not sure_to_stop(self):
            event.ignore()
            return
        self._remember()
        self.shut_down()
        event.accept()

    def end(self) -> None:
        """Stop, save and leave without a question."""
        self.shut_down()
        QApplication.exit()

    def shut_down(self) -> None:
        """Stop and save, cancel computations. Twice does no harm."""
        self.space.calibrating.cancel()
        self.space.recording.stop_and_wait()
        self.space.tasks.finish()
        self.space.quiet_tasks.finish()
