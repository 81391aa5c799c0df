"""What pages share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoCommand, QUndoStack

from draglag.analysis import Analysis, AnalysisOptions, analyze, with_stylus
from draglag.errors import DraglagError
from draglag.protocol.runs import Protocol, load_protocol
from draglag.provenance import is_simulated
from draglag.recording import Session
from draglag.store import PARTIAL, FileState, add_analysis, read_analyses, read_with_state
from draglag_app.windows.bridge import SessionBridge
from draglag_app.windows.parts.recent_menu import remembered
from draglag_app.windows.parts.tasks import Progress, Tasks
from draglag_app.windows.recording.calibrating import Calibrating
from draglag_app.windows.recording.live_estimates import LiveEstimates
from draglag_app.windows.recording.session_thread import Recording
from draglag_app.windows.settings import Settings, save_settings
from draglag_app.windows.wording.i18n import language_of
from draglag_app.windows.wording.library_words import in_words


class Edit(QUndoCommand):
    """One undoable change."""

    def __init__(self, text: str, do: Callable[[], object], undo: Callable[[], object]) -> None:
        super().__init__(text)
        self._do = do
        self._undo = undo

    def redo(self) -> None:
        self._do()

    def undo(self) -> None:
        self._undo()


class Workspace(QObject):
    """What the pages of a window share; signals announce changes."""

    settings_changed = Signal()
    protocol_changed = Signal()
    session_changed = Signal()
    """Another session was opened, or none is open."""
    analysis_changed = Signal()
    comments_changed = Signal()
    noticed = Signal(str, object)
    """(level, sentence) for the operator."""
    saved = Signal(object)
    """The path of a file written for the operator."""

    def __init__(self, settings: Settings, settings_file: Path, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.settings = settings
        self.settings_file = settings_file
        self.language = language_of(settings.language)  # of all texts, until the window is opened again
        self.undo = QUndoStack(self)
        self.tasks = Tasks(self)
        self.quiet_tasks = Tasks(self)  # work nobody asked for; it shows no progress and gives way to a recording
        self.bridge = SessionBridge(self)
        self.recording = Recording(self.bridge, self)
        self.calibrating = Calibrating(self)
        self.protocol = self._first_protocol()
        self.session: Session | None = None
        self.path: Path | None = None
        self.state: FileState | None = None
        self.analysis: Analysis | None = None
        self.options = AnalysisOptions()
        self.comments: dict[str, str] = {}  # on runs of the session at hand
        self.live = LiveEstimates(self)
        self.recording.ended.connect(self._ended)

    # --- settings and protocol ------------------------------------------------------------------------------

    def change_settings(self, **changes: Any) -> None:
        """Change and save settings."""
        self.settings = self.settings.model_copy(update=changes)
        try:
            save_settings(self.settings, self.settings_file)
        except DraglagError as error:
            self.noticed.emit("warning", error.message)
        self.settings_changed.emit()

    def change_protocol(self, protocol: Protocol, what: str) -> None:
        """Change the protocol; undoable."""
        before = self.protocol
        if protocol != before:
            self.undo.push(Edit(what, lambda: self.set_protocol(protocol), lambda: self.set_protocol(before)))

    def set_protocol(self, protocol: Protocol) -> None:
        self.protocol = protocol
        self.protocol_changed.emit()

    def _first_protocol(self) -> Protocol:
        try:
            return load_protocol(self.settings.protocol)
        except DraglagError:
            return load_protocol("latency-sweep")

    # --- the session at hand --------------------------------------------------------------------------------

    @property
    def simulated(self) -> bool:
        """Whether recording or open session is simulated."""
        order = self.recording.order if self.recording.active else None
        if order is not None:
            return any(source.address.startswith("sim:") for source in order.rig.sources)
        return self.session is not None and is_simulated(self.session.devices)

    def open(self, path: Path, done: Callable[[], object] | None = None) -> None:
        """Read a session file in a worker, then analyse it; ``done`` is called once read."""

        def take(got: tuple[Session, FileState, dict[str, str]]) -> None:
            self.take(got[0], path, got[2], got[1])
            self.change_settings(recent=tuple(remembered(path, self.settings.recent)))
            if done is not None:
                done()

        def work(progress: Progress) -> tuple[Session, FileState, dict[str, str]]:
            progress(0.1, path.name)
            return *read_with_state(path), kept_comments(path)

        self.tasks.start(self.tr("Reading"), work, take, self.fault)

    def take(
        self,
        session: Session,
        path: Path | None,
        comments: Mapping[str, str] | None = None,
        state: FileState | None = None,
    ) -> None:
        """Open and analyse a session; ``comments``: by run; ``state``: of its file when it was read."""
        self.session, self.path, self.state, self.analysis = session, path, state, None
        self.comments = dict(comments or {})
        self.options = replace(self.options, exclude={}, include=frozenset(), stylus_mm=None)  # of the session before
        self.undo.clear()
        self.session_changed.emit()
        self.analyse()

    def analyse(self) -> None:
        """Estimate again with the present options."""
        session, options = self.session, self.options
        if session is None:
            return
        self.tasks.start(
            self.tr("Analysing"), lambda progress: analyze(session, options, progress), self._analysed, self.fault
        )

    def set_options(self, options: AnalysisOptions) -> None:
        self.options = options
        self.analyse()

    def exclude(self, run_id: str, reason: str) -> None:
        """Leave a run out of the curve; undoable."""
        before = self.options
        after = replace(before, exclude={**before.exclude, run_id: reason}, include=before.include - {run_id})
        self._change_runs(self.tr("exclude {run}").format(run=run_id), before, after)

    def include(self, run_id: str) -> None:
        """Use a run in the curve that was left out; undoable."""
        before = self.options
        left_out = {key: why for key, why in before.exclude.items() if key != run_id}
        after = replace(before, exclude=left_out, include=before.include | {run_id})
        self._change_runs(self.tr("include {run}").format(run=run_id), before, after)

    @property
    def corrected(self) -> Session | None:
        """The session with the diameter of its stylus as corrected."""
        return None if self.session is None else with_stylus(self.session, self.options.stylus_mm)

    def correct_stylus(self, diameter_mm: float) -> None:
        """Analyse with that diameter of the stylus; undoable."""
        if self.session is None:
            return
        before, recorded_mm = self.options.stylus_mm, self.session.stylus.diameter_mm
        after = None if diameter_mm == recorded_mm else diameter_mm

        def to(stylus_mm: float | None) -> None:
            self.set_options(replace(self.options, stylus_mm=stylus_mm))

        if after != before:
            self.undo.push(Edit(self.tr("diameter of the stylus"), lambda: to(after), lambda: to(before)))

    def comment(self, run_id: str, text: str) -> None:
        """Comment on a run; empty removes it; undoable."""
        before = dict(self.comments)
        after = {key: said for key, said in {**before, run_id: text}.items() if said}
        if after != before:
            what = self.tr("comment on {run}").format(run=run_id)
            self.undo.push(Edit(what, lambda: self._set_comments(after), lambda: self._set_comments(before)))

    def _set_comments(self, comments: dict[str, str]) -> None:
        self.comments = comments
        self.comments_changed.emit()

    def _change_runs(self, what: str, before: AnalysisOptions, after: AnalysisOptions) -> None:
        def to(runs: AnalysisOptions) -> None:
            self.set_options(replace(self.options, exclude=runs.exclude, include=runs.include))

        if after != before:
            self.undo.push(Edit(what, lambda: to(after), lambda: to(before)))

    def keep_analysis(self) -> None:
        """Store the analysis in the session's file."""
        path, analysis, state = self.path, self.analysis, self.state
        if path is None or analysis is None:
            return
        options = analysis.options.kept() | ({"comments": dict(self.comments)} if self.comments else {})
        made = datetime.now(UTC).isoformat(timespec="seconds")

        def work(progress: Progress) -> int:
            return add_analysis(path, analysis.to_dict(), options, made, state)

        def done(number: int) -> None:
            text = self.tr("The results are kept in {file} as analysis {number}.")
            self.noticed.emit("info", text.format(file=path.name, number=number))

        self.tasks.start(self.tr("Keeping results"), work, done, self.fault)

    def _analysed(self, analysis: Analysis) -> None:
        if self.session is None or analysis.session != self.session.name:
            return
        self.analysis = analysis
        self.analysis_changed.emit()

    def fault(self, text: str) -> None:
        """Show an error to the operator."""
        self.noticed.emit("error", text)

    # --- recording ------------------------------------------------------------------------------------------

    def _ended(self, path: Path | None, problem: str) -> None:
        if problem:
            # A file that could not be closed keeps the ending it had while it was written.
            whole = path is not None and path.suffix != PARTIAL
            saved = " " + self.tr("Saved: {path}").format(path=path) if whole else ""
            self.noticed.emit("warning" if whole else "error", in_words(problem) + saved)
        if path is not None:
            self.open(path)


def kept_comments(path: Path) -> dict[str, str]:
    """Run → comment, as last stored."""
    try:
        stored = read_analyses(path)
    except DraglagError:
        return {}
    found: object = next((one.options["comments"] for one in reversed(stored) if "comments" in one.options), {})
    return {str(run): str(text) for run, text in found.items()} if isinstance(found, dict) else {}
