"""Windows for tests, and fixtures that fail on what a test leaves behind."""

from __future__ import annotations

import gc
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
import shiboken6
from PySide6.QtCore import QCoreApplication, QEvent, QEventLoop, QObject, QThread, QTimer
from PySide6.QtWidgets import QApplication

from draglag.analysis import Analysis, analyze
from draglag.protocol.runs import Protocol, load_protocol
from draglag.recording import Session
from draglag.store import FileState, read_with_state
from draglag_app.cli.record import session_options
from draglag_app.session import OffscreenDisplay, SessionOptions, run_session
from draglag_app.windows import start, workspace
from draglag_app.windows.application import make_application
from draglag_app.windows.parts.garbage import Garbage, collect_in_this_thread
from draglag_app.windows.settings import RigSettings, Settings
from draglag_app.windows.window import OperatorWindow
from draglag_devices.rig import make_rig

SIMULATED = RigSettings(touch="sim:", laser="sim:", walt="sim:", fast=True, display="offscreen")
ShowSession = Callable[..., None]
_TICK_MS = 2
_MANY_OBJECTS = 100_000  # a window and all it holds are a tenth of it


def short_protocol() -> Protocol:
    """Six circles, a chirp and some taps: enough for a curve and a validation."""
    demo = load_protocol("demo")
    slow = demo.runs[0].model_copy(update={"speeds_mm_s": (44.0, 102.0, 240.0), "duration_s": 30.0})
    quick = demo.runs[1].model_copy(update={"speeds_mm_s": (425.0, 750.0, 1000.0), "duration_s": 20.0})
    taps = demo.taps.model_copy(update={"count": 10}) if demo.taps else None
    return demo.model_copy(update={"runs": (slow, quick, demo.runs[2]), "taps": taps, "clock_check": None})


def settle(qapp: QApplication) -> None:
    """Deliver what is queued and delete what is to be deleted."""
    for _ in range(5):
        qapp.processEvents()
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


def wait_until(qapp: QApplication, so: Callable[[], bool], limit_s: float = 120.0) -> None:
    """Run the event loop until something is so; between events the processor is left to those that work."""
    end_s = time.monotonic() + limit_s
    tick = QTimer()  # not every change comes with an event
    tick.start(_TICK_MS)
    while not so():
        qapp.processEvents(QEventLoop.ProcessEventsFlag.WaitForMoreEvents)
        assert time.monotonic() < end_s, "it never came about"


def _of_python() -> set[object]:
    return {t for t in threading.enumerate() if t.name.startswith("draglag")}


def _runs(item: QObject) -> bool:
    """Whether it is a timer or a thread at work, other than the program's own of every test."""
    if not shiboken6.isValid(item):
        return False
    if isinstance(item, QTimer):
        return item.isActive() and not isinstance(item.parent(), Garbage)
    return isinstance(item, QThread) and item.isRunning() and not item.isMainThread()


@pytest.fixture(scope="session", autouse=True)
def garbage_as_in_the_program(qapp: QApplication) -> Iterator[None]:
    """Collected in the windows' thread alone; elsewhere in the tests as Python does."""
    garbage = collect_in_this_thread(qapp)
    yield
    garbage.stop()


def _set_aside() -> None:
    """What imports and earlier tests have made is not looked at again: a million objects, each time for a second."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="module", autouse=True)
def only_new_objects_are_looked_at() -> None:
    _set_aside()


def _things(qapp: QApplication) -> dict[str, set[object]]:
    made = {item for item in shiboken6.getAllValidWrappers() if isinstance(item, (QTimer, QThread)) and _runs(item)}
    return {"top-level widgets": set(qapp.topLevelWidgets()), "timers and threads": made | _of_python()}


def _left(qapp: QApplication, before: dict[str, set[object]]) -> list[str]:
    """What is there now and was not before; what only garbage holds is gone, before the next window is built."""
    left: list[str] = []
    for _ in range(2):  # what goes may leave garbage itself
        settle(qapp)
        gc.collect()
        settle(qapp)
        left = [f"{name}: {item}" for name, now in _things(qapp).items() for item in now - before[name]]
        if not left:
            break
    return left


@pytest.fixture(autouse=True)
def nothing_left_behind(qapp: QApplication) -> Iterator[None]:
    """Fail on top-level widgets, running timers and threads that a test leaves behind."""
    before = _things(qapp)
    yield
    left = _left(qapp, before)
    if len(gc.get_objects()) > _MANY_OBJECTS:  # a session that a window recorded has brought all of them back
        gc.freeze()  # they have just been looked at
    assert not left, f"left behind: {left}"
    loop = QEventLoop()
    QTimer.singleShot(0, loop.quit)
    assert loop.exec() == 0, "a request to leave is left behind: it would end the dialogs of later tests"


@pytest.fixture
def open_window(qapp: QApplication, tmp_path: Path) -> Iterator[Callable[..., OperatorWindow]]:
    """Make an operator's window on a simulated rig; it is closed afterwards."""
    made: list[OperatorWindow] = []

    def make(**changes: object) -> OperatorWindow:
        known = {"first_start": False, "folder": str(tmp_path / "sessions"), "protocol": "demo", "rig": SIMULATED}
        settings = Settings.model_validate({**known, **changes})
        make_application([], settings)
        window = OperatorWindow(settings, tmp_path / "settings.toml")
        window.space.set_protocol(short_protocol())
        window.show()
        made.append(window)
        return window

    yield make
    for window in made:
        window.shut_down()
        wait_until(qapp, lambda window=window: not window.space.recording.active)
        settle(qapp)
        window.space.tasks.finish()
        window.close()
        window.deleteLater()
    settle(qapp)


@pytest.fixture
def short_countdown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Targets of windows' sessions stand still for half a second: for tests in real time of what comes afterwards."""
    monkeypatch.setattr(start, "SessionOptions", partial(SessionOptions, countdown_s=0.5))


@pytest.fixture
def recorded(open_window: Callable[..., OperatorWindow], qapp: QApplication) -> OperatorWindow:
    """A window in which a whole simulated session has just been recorded and analysed."""
    window = open_window()
    window.ask("start")
    wait_until(qapp, lambda: window.space.analysis is not None and not window.space.tasks.running)
    return window


@pytest.fixture(scope="session")
def session_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded session, made without windows."""
    protocol, out = short_protocol(), tmp_path_factory.mktemp("recorded") / "session.h5"
    rig = make_rig(SIMULATED.addresses(), "screen-1", protocol.seed, fast=True)
    return run_session(protocol, rig, OffscreenDisplay(), out, session_options(rig, "screen-1", None))


@pytest.fixture(scope="session")
def analysis_of_file(session_file: Path) -> tuple[Session, FileState, Analysis]:
    """The recorded session, read and analysed once for all windows that only show it."""
    session, state = read_with_state(session_file)
    return session, state, analyze(session)


@pytest.fixture
def show_session(
    qapp: QApplication, session_file: Path, analysis_of_file: tuple[Session, FileState, Analysis]
) -> ShowSession:
    """Open the recorded session, or a copy of it, in a window that is to show its analysis."""
    session, state, analysis = analysis_of_file

    def show(window: OperatorWindow, path: Path = session_file) -> None:
        assert window.space.options == analysis.options
        with pytest.MonkeyPatch.context() as known:
            known.setattr(workspace, "read_with_state", lambda _: (session, state))
            known.setattr(workspace, "kept_comments", lambda _: {})
            known.setattr(workspace, "analyze", lambda *_: analysis)
            window.space.open(path)
            wait_until(qapp, lambda: window.space.analysis is not None and not window.space.tasks.running)

    return show


@pytest.fixture
def opened(
    open_window: Callable[..., OperatorWindow], show_session: ShowSession, session_file: Path, tmp_path: Path
) -> OperatorWindow:
    """A window with a recorded session at hand, analysed."""
    window = open_window()
    show_session(window, Path(shutil.copy(session_file, tmp_path / "session.h5")))
    return window


@pytest.fixture
def until(qapp: QApplication) -> Callable[[Callable[[], bool]], None]:
    """Run the event loop until something is so."""
    return lambda so: wait_until(qapp, so)
