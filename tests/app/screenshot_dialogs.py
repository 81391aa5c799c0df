"""Pictures of dialogs, and of the window at work or in trouble."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication, QLineEdit, QMessageBox

from app.screenshot_camera import Camera
from draglag.errors import DataError
from draglag.instruments.orientation import WORDS
from draglag.messages import message
from draglag.protocol.runs import load_protocol
from draglag_app.session import events
from draglag_app.session.place import elsewhere
from draglag_app.windows import files
from draglag_app.windows.leaving import sure_to_stop
from draglag_app.windows.settings import Settings
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.library_words import in_words
from draglag_devices.source import DeviceError

TOUCH = DeviceError(
    "evdev:/dev/input/by-id/usb-ILITEK_Multi-Touch-V3000-event",
    message("it was unplugged ({why})", why="No such device"),
    "plug it in again",
)
PARTIAL = Path("/home/lab/sessions/2026-11-21_152622_demo-screen-1.h5.partial")
DETAILS = {"participant": "P07", "session_label": "2", "operator": "Zoë", "fields": {"handedness": "left"}}


def questions(window: OperatorWindow, camera: Camera) -> None:
    """A session's details, a rig without a WALT and with a broken touchscreen, a run to exclude, a crash, leaving."""
    window.go("record")
    whole = window.space.settings
    window.space.change_settings(**DETAILS)
    camera.take_asked(window, "ask-details", window.ask_details)
    window.space.change_settings(**{name: getattr(whole, name) for name in DETAILS})
    window.space.change_settings(rig=whole.rig.model_copy(update={"walt": ""}))
    window.header.set_light("touch", "fault", in_words(TOUCH.message))
    camera.take_asked(window, "ask-start", window.start)
    window.space.change_settings(rig=whole.rig)
    results = window.pages["results"][1]
    window.go("results")
    results.table.selectRow(2)
    camera.take_asked(window, "ask-exclude", results.exclude_button.click)
    left = Path(whole.folder) / PARTIAL.name
    left.write_bytes(b"")
    camera.take_asked(window, "ask-salvage", lambda: files.offer_salvage(window))
    left.unlink()
    camera.take_asked(window, "ask-close", lambda: sure_to_stop(window))


def troubles(application: QApplication, window: OperatorWindow, camera: Camera) -> Iterator[str]:
    """Notices: a lost device, a turned panel, a full disk."""
    bridge = window.space.bridge
    window.go("record")
    bridge.device_fault.emit(events.DeviceFault("touch", TOUCH.source, TOUCH.problem, TOUCH.remedy))
    yield "trouble-lost"
    turned = message(
        "The touches are {how} against the target: screen or touchscreen was turned after the calibration. "
        "Stop, calibrate the touchscreen again, and start again.",
        how=WORDS["turned"],
    )
    bridge.notice_raised.emit(events.NoticeRaised(0.0, "error", "touch", turned))
    yield "trouble-turned"
    full = DataError(message("{path}: cannot be written ({why})", path=PARTIAL, why="No space left on device"))
    bridge.notice_raised.emit(events.NoticeRaised(0.0, "error", "file", elsewhere(full, PARTIAL).message))
    yield "trouble-disk"
    window.notify("", "")


def in_a_rest(application: QApplication, settings: Settings, folder: Path, camera: Camera) -> None:
    """A calibration; then a rest between runs, in which one may be repeated and a note written."""
    window = _with_long_rests(settings, folder, "offscreen")
    window.ask("calibrate")
    camera.wait(application, lambda: len(window.space.calibrating.touches.found) >= 2)
    camera.take(window, "calibrating")
    window.space.calibrating.cancel()
    window.start()
    verdicts = ("good", "warning", "bad")
    camera.wait(
        application, lambda: window.record.big.property("level") in verdicts and not window.space.live.preliminary
    )
    window.ask("note")
    window.record.note.setText("stylus tip changed after this run")
    camera.take(window, "resting")
    _leave(application, window, camera)


def on_one_monitor(application: QApplication, settings: Settings, folder: Path, camera: Camera) -> None:
    """The participant's screen in a rest, where it is the operator's too."""
    window = _with_long_rests(settings, folder, "screen 1")
    screen = application.screens()[0]
    window.setScreen(screen)
    window.setGeometry(screen.geometry())
    asked, QMessageBox.question = QMessageBox.question, lambda *asked, **more: QMessageBox.StandardButton.Yes
    window.start()  # although that screen has not the panel's shape
    QMessageBox.question = asked
    participant = window.space.recording.window
    camera.wait(application, lambda: any(line.isVisible() for line in participant.findChildren(QLineEdit)))
    camera.take(participant, "one-monitor-rest")
    _leave(application, window, camera)


def _with_long_rests(settings: Settings, folder: Path, display: str) -> OperatorWindow:
    rig = settings.rig.model_copy(update={"fast": False, "display": display})
    window = OperatorWindow(
        settings.model_copy(update={"rig": rig, "folder": str(folder)}), folder.with_suffix(".toml")
    )
    demo = load_protocol("demo")
    short = demo.runs[1].model_copy(update={"speeds_mm_s": (425.0, 760.0), "duration_s": 2.0})
    window.space.set_protocol(
        demo.model_copy(update={"runs": (short,), "taps": None, "clock_check": None, "rest_s": 600.0})
    )
    window.show()
    return window


def _leave(application: QApplication, window: OperatorWindow, camera: Camera) -> None:
    window.shut_down()
    camera.wait(application, lambda: not window.space.recording.active)
    window.close()
    window.deleteLater()
    application.sendPostedEvents(None, QEvent.Type.DeferredDelete)
