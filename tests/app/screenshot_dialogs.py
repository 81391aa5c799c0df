"""Pictures of dialogs, and of the window at work or in trouble, in both themes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QEvent, QEventLoop, QTimer
from PySide6.QtWidgets import QApplication, QDialog, QWidget

from draglag.errors import DataError
from draglag.instruments.orientation import WORDS
from draglag.messages import message
from draglag.protocol.runs import load_protocol
from draglag_app.session import events
from draglag_app.session.place import elsewhere
from draglag_app.windows import files
from draglag_app.windows.leaving import sure_to_stop
from draglag_app.windows.settings import RigSettings, Settings
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.library_words import in_words
from draglag_devices.source import DeviceError

Shoot = Callable[[QWidget, Path], None]
Wait = Callable[..., None]
TOUCH = DeviceError(
    "evdev:/dev/input/by-id/usb-ILITEK_Multi-Touch-V3000-event",
    message("it was unplugged ({why})", why="No such device"),
    "plug it in again",
)


def _asked(ask: Callable[[], object], path: Path, shoot: Shoot) -> None:
    """Let the window ask, take a picture of the question, and say no."""

    waiting, looking = QEventLoop(), QTimer()
    left = [200]

    def answer() -> None:
        box = QApplication.activeModalWidget()
        left[0] -= 1
        if isinstance(box, QDialog):
            looking.stop()
            shoot(box, path)
            box.reject()
            waiting.quit()
        elif not left[0]:
            looking.stop()
            waiting.quit()

    looking.timeout.connect(answer)
    looking.start(100)  # on a busy computer a dialog takes its time
    ask()
    if looking.isActive():
        waiting.exec()  # a dialog that is only shown is answered here
    if not path.exists():
        raise SystemExit(f"nothing was asked for {path.name}")


def questions(window: OperatorWindow, theme: str, out: Path, shoot: Shoot) -> None:
    """A rig without a WALT and with a broken touchscreen, a run to exclude, a crash's leftovers, leaving."""
    whole = window.space.settings.rig
    window.space.change_settings(rig=whole.model_copy(update={"walt": ""}))
    window.header.set_light("touch", "fault", in_words(TOUCH.message))
    _asked(window.start, out / f"ask-start-{theme}.png", shoot)
    window.space.change_settings(rig=whole)
    results = window.pages["results"][1]
    window.go("results")
    results.table.selectRow(2)
    _asked(results.exclude_button.click, out / f"ask-exclude-{theme}.png", shoot)
    partial = Path(window.space.settings.folder) / "2026-11-02_101500_latency-sweep-screen-1.h5.partial"
    partial.write_bytes(b"")
    _asked(lambda: files.offer_salvage(window), out / f"ask-salvage-{theme}.png", shoot)
    partial.unlink()
    _asked(lambda: sure_to_stop(window), out / f"ask-close-{theme}.png", shoot)


def troubles(window: OperatorWindow, theme: str, out: Path, shoot: Shoot) -> None:
    """Notices: a lost device, a turned panel, a full disk."""
    bridge = window.space.bridge
    window.go("record")
    bridge.device_fault.emit(events.DeviceFault("touch", TOUCH.source, TOUCH.problem, TOUCH.remedy))
    shoot(window, out / f"trouble-lost-{theme}.png")
    turned = message(
        "The touches are {how} against the target: screen or touchscreen was turned after the calibration. "
        "Stop, calibrate the touchscreen again, and start again.",
        how=WORDS["turned"],
    )
    bridge.notice_raised.emit(events.NoticeRaised(0.0, "error", "touch", turned))
    shoot(window, out / f"trouble-turned-{theme}.png")
    partial = Path("/home/lab/sessions/2026-11-21_152622_demo-screen-1.h5.partial")
    full = DataError(message("{path}: cannot be written ({why})", path=partial, why="No space left on device"))
    bridge.notice_raised.emit(events.NoticeRaised(0.0, "error", "file", elsewhere(full, partial).message))
    shoot(window, out / f"trouble-disk-{theme}.png")
    window.notify("", "")


def under_way(
    application: QApplication, folder: Path, theme: str, language: str, out: Path, shoot: Shoot, wait: Wait
) -> None:
    """A rest between runs, in which one may be repeated and a note written; a calibration."""
    rig = RigSettings(touch="sim:", laser="sim:", walt="sim:", fast=False, display="offscreen")
    settings = Settings(
        first_start=False, folder=str(folder / theme), protocol="demo", rig=rig, theme=theme, language=language
    )
    window = OperatorWindow(settings, folder / f"{theme}.toml")
    window.use_theme(theme)
    demo = load_protocol("demo")
    short = demo.runs[1].model_copy(update={"speeds_mm_s": (425.0, 760.0), "duration_s": 2.0})
    window.space.set_protocol(
        demo.model_copy(update={"runs": (short,), "taps": None, "clock_check": None, "rest_s": 60.0})
    )
    window.show()
    window.ask("calibrate")
    wait(application, lambda: len(window.space.calibrating.touches.found) >= 2)
    shoot(window, out / f"calibrating-{theme}.png")
    window.space.calibrating.cancel()
    window.start()
    verdicts = ("good", "warning", "bad")
    wait(application, lambda: window.record.big.property("level") in verdicts and not window.space.live.preliminary)
    window.ask("note")
    window.record.note.setText("stylus tip changed after this run")
    shoot(window, out / f"resting-{theme}.png")
    window.shut_down()
    wait(application, lambda: not window.space.recording.active)
    window.close()
    window.deleteLater()
    application.sendPostedEvents(None, QEvent.Type.DeferredDelete)
