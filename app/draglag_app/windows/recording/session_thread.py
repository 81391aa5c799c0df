"""The session's thread, started from the window."""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QGuiApplication

from draglag.errors import DataError, cause, message_of
from draglag.messages import message
from draglag.protocol.runs import PlannedRun, Protocol, expand, planned_after_s
from draglag.recording import Run
from draglag_app.session import Control, Display, OffscreenDisplay, SessionOptions, events, run_session
from draglag_app.windows.bridge import SessionBridge
from draglag_app.windows.participant.contact import Contact
from draglag_app.windows.participant.docked import show_picture
from draglag_app.windows.participant.screen_display import ScreenDisplay, WatchedDisplay, numbered_screen
from draglag_app.windows.participant.side_by_side import operators_window
from draglag_app.windows.participant.window import ParticipantWindow
from draglag_app.windows.wording.i18n import translate
from draglag_app.windows.wording.library_words import CLOSED, ESC
from draglag_devices.rig import Rig


@dataclass(frozen=True)
class Order:
    """What to record; ``display``: "window", "offscreen" or "screen N"."""

    protocol: Protocol
    rig: Rig
    out: Path
    options: SessionOptions
    display: str = "window"
    auto: bool = True


class Recording(QObject):
    """Starts and steers one session. Signals come in the window's thread."""

    began = Signal(object)
    ended = Signal(object, object)
    """(path or None, problem): the file is closed, or there is none."""

    def __init__(self, bridge: SessionBridge, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._bridge = bridge
        self._thread: threading.Thread | None = None
        self._plan: dict[str, PlannedRun] = {}
        self._contact = Contact()
        self.control: Control | None = None
        self.order: Order | None = None
        self.window: ParticipantWindow | None = None
        self.dock: Callable[[ParticipantWindow], object] | None = None  # takes a picture that has no room of its own
        bridge.session_finished.connect(self._finished)
        bridge.crashed.connect(self._crashed)
        bridge.state_changed.connect(self._state_changed)
        bridge.samples_arrived.connect(self._samples_arrived)

    @property
    def active(self) -> bool:
        return self._thread is not None

    def start(self, order: Order) -> None:
        """Begin. Raises DraglagError."""
        if self.active:
            raise DataError("a session is being recorded already", "Stop it first")
        if order.out.exists():
            raise DataError(
                message("{path}: exists already and is not overwritten", path=order.out), "Choose another name"
            )
        plan = expand(order.protocol, order.options.screen, order.options.seed, beam=order.options.beam)
        try:
            order.out.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DataError(
                message("{path}: cannot be made ({why})", path=order.out.parent, why=cause(error)),
                "Choose another folder for sessions on the page Preferences",
            ) from None
        self._plan = {planned.id: planned for planned in plan}
        display: Display = OffscreenDisplay()
        if order.display != "offscreen" and order.rig.stage.time_base.realtime:
            display = self._participant(order)
        display = WatchedDisplay(display, self._bridge.listener)
        self.order = order
        self._contact = Contact()
        self.control = Control(order.auto, asks=True, retries=True)
        control = self.control

        def work() -> None:
            try:
                run_session(
                    order.protocol, order.rig, display, order.out, order.options, self._bridge.listener, control
                )
            except Exception as error:  # reported by the bridge; the window decides what to say
                self._bridge.failed(error)

        # A look for garbage among all that the windows are made of takes as long as several of the target's frames:
        # now, and then not until the end. What the session makes itself is looked at all the same.
        gc.collect()
        gc.freeze()
        self._thread = threading.Thread(target=work, name="draglag-session")
        self._thread.start()
        self.began.emit(order)

    def planned(self, run: str | Run) -> PlannedRun | None:
        """A run's plan, also for repeats (run-03-2)."""
        run_id = run if isinstance(run, str) else run.id
        return self._plan.get(run_id) or self._plan.get("-".join(run_id.split("-")[:2]))

    def left_s(self, run_number: int, tapped: bool = False) -> float:
        """Time planned after that run (from 1), with queued runs; ``tapped``: the taps are done too."""
        order, control = self.order, self.control
        if order is None:
            return 0.0
        queued = control.queued if control is not None else ()
        again = [self._plan[run_id] for run_id in queued if run_id in self._plan]
        plan = [*list(self._plan.values())[run_number:], *again]
        protocol = order.protocol.model_copy(update={"taps": None}) if tapped else order.protocol
        return planned_after_s(protocol, plan, order.options.countdown_s)

    def stop_and_wait(self) -> None:
        """End the session, and wait until its file is closed."""
        if self.control is not None:
            self.control.no_place()
            self.control.stop()
        if self._thread is not None:
            self._thread.join()

    # --- the participant's window ---------------------------------------------------------------------------

    def _participant(self, order: Order) -> Display:
        screen = None
        if order.display.startswith("screen"):
            screen = numbered_screen(int(order.display.split()[-1]))
        window = ParticipantWindow(order.options.screen)
        window.aborted.connect(lambda: self._aborted(ESC))
        window.closing.connect(lambda: self._aborted(CLOSED))
        show_picture(window, screen, operators_window(self), self.dock)
        self.window = window
        return ScreenDisplay(window)

    def _aborted(self, why: str) -> None:
        if self.control is not None:
            self.control.note(why)
            self.control.abort_run()
            self._bridge.listener(events.NoticeRaised(time.monotonic(), "warning", "participant", why))

    def _state_changed(self, event: events.StateChanged) -> None:
        planned = self.planned(event.run_id)
        if self.window is not None and planned is not None:
            self.window.set_practice(planned.practice)

    def _samples_arrived(self, event: events.SamplesArrived) -> None:
        if event.role == "touch":
            touching = self._contact.take(event)
            if self.window is not None:
                self.window.set_contact(touching)

    # --- the end --------------------------------------------------------------------------------------------

    def _finished(self, event: events.SessionFinished) -> None:
        self._close(event.path, event.problem)

    def _crashed(self, error: Exception) -> None:
        self._close(None, message_of(error) or type(error).__name__)

    def _close(self, path: Path | None, problem: str) -> None:
        if self._thread is None:  # a failure reported twice
            return
        self._thread.join()
        self._thread = None
        gc.unfreeze()
        self.control = None
        if self.window is not None:
            self.window.close()
            self.window.deleteLater()
            self.window = None
        self.ended.emit(path if path is not None and path.exists() else None, problem)


def display_choices() -> list[tuple[str, str]]:
    """(value, words) of where the participant can look."""
    rows = [
        ("window", translate("Bench", "In a window")),
        ("offscreen", translate("Bench", "Nowhere (no participant)")),
    ]
    for k, screen in enumerate(QGuiApplication.screens(), 1):
        words = translate("Bench", "Screen {k}: {name}").format(k=k, name=screen.name())
        rows.append((f"screen {k}", f"{words} {screen.size().width()}×{screen.size().height()}"))
    return rows
