"""The manual's pictures, one a page and one plot: ``./run screenshots --manual``. Light, made smaller, few colours."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from pathlib import Path

from PIL import Image
from PySide6.QtCore import QBuffer, QByteArray, QEvent, QIODevice, Qt
from PySide6.QtWidgets import QApplication, QWidget

from draglag.exchange import read_exchange
from draglag.protocol.runs import load_protocol
from draglag_app.windows.settings import RigSettings, Settings
from draglag_app.windows.window import OperatorWindow

FOLDER = Path(__file__).parents[2] / "resources" / "draglag_resources" / "manual" / "pictures"
SHOWN = ("bench", "geometry", "protocol", "record", "results", "gap", "compare", "preferences")
SIZE, WIDE_PX, MOST_BYTES = (1280, 800), 880, 60_000
# What the pictures name in the place of folders of the computer they are made on.
_SESSIONS = "/home/lab/sessions"

Wait = Callable[..., None]


def small(widget: QWidget, path: Path, wide_px: int = WIDE_PX) -> None:
    """A picture of a widget with as many colours as its size allows. Raises SystemExit where even 16 are too many."""
    QApplication.processEvents()
    drawn = widget.grab().toImage().scaledToWidth(wide_px, Qt.TransformationMode.SmoothTransformation)
    kept = QByteArray()
    buffer = QBuffer(kept)
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    drawn.save(buffer, "PNG")
    picture = Image.open(io.BytesIO(kept.data())).convert("RGB")
    for colours in (128, 64, 32, 16):
        out = io.BytesIO()
        picture.quantize(colours, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
        if len(out.getvalue()) < MOST_BYTES:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(out.getvalue())
            return
    raise SystemExit(f"{path.name} is too large")


def make(application: QApplication, folder: Path, out: Path, wait: Wait) -> None:
    """All of them, on the simulated rig: a session measured, one under way, and a gap explained."""
    rig = RigSettings(touch="sim:", laser="sim:", walt="sim:", fast=True, display="offscreen")
    settings = Settings(first_start=False, folder=str(folder), protocol="demo", rig=rig, theme="light")
    window = _shown(settings, folder / "settings.toml")
    window.start()
    wait(application, lambda: window.space.analysis is not None and not window.space.tasks.running)
    window.notify("", "")
    window.ask("calibrate")
    wait(application, lambda: not window.space.calibrating.active)
    window.pages["compare"][1]._add_present()
    window.space.change_settings(folder=_SESSIONS)
    for name in SHOWN:
        if name == "gap":
            window.space.take(
                read_exchange(Path(__file__).parents[1] / "data" / "exchange" / "low_speed_plateau"), None
            )
            wait(application, lambda: window.space.analysis is not None and not window.space.tasks.running)
            window.pages["gap"][1].start()
        if name == "compare":
            window.pages["compare"][1]._add_present()
        window.go(name)
        wait(application, lambda: not window.space.tasks.running)
        if name == "protocol":
            wait(application, lambda: window.pages["protocol"][1].precision.plan is not None)
        if name != "record":
            small(window, out / f"{name}.png")
        if name == "results":
            results = window.pages[name][1]
            results.show_residuals.click()
            small(results.curve, out / "residuals.png", results.curve.width())
            results.show_residuals.click()
    window.close()
    recording(
        application, settings.model_copy(update={"rig": rig.model_copy(update={"fast": False})}), folder, out, wait
    )


def recording(application: QApplication, settings: Settings, folder: Path, out: Path, wait: Wait) -> None:
    """The Record page in the midst of its second run."""
    window = _shown(settings, folder / "live.toml")
    into_the_second_run(application, window, wait)
    small(window, out / "record.png")
    leave(application, window, wait)


def into_the_second_run(application: QApplication, window: OperatorWindow, wait: Wait, second_s: float = 9.0) -> None:
    """A recording, in real time, up to the midst of its second run, which lasts for ``second_s``."""
    demo = load_protocol("demo")
    # So fast sideways that even these short runs travel far enough.
    runs = tuple(
        demo.runs[1].model_copy(update={"speeds_mm_s": (speed,), "duration_s": lasts_s, "sideways_px_s": 60.0})
        for speed, lasts_s in ((425.0, 9.0), (760.0, second_s))
    )
    short = {"runs": runs, "shuffle": False, "taps": None, "clock_check": None, "rest_s": 1.0}
    window.space.set_protocol(demo.model_copy(update=short))
    window.start()
    wait(application, lambda: len(window.space.live.known) == 1, 60)
    end_s = time.monotonic() + 10
    wait(application, lambda: time.monotonic() > end_s)


def leave(application: QApplication, window: OperatorWindow, wait: Wait) -> None:
    """End a recording and close its window."""
    window.shut_down()
    wait(application, lambda: not window.space.recording.active)
    window.close()
    application.sendPostedEvents(None, QEvent.Type.DeferredDelete)


def _shown(settings: Settings, file: Path) -> OperatorWindow:
    window = OperatorWindow(settings, file)
    window.use_theme("light")
    window.show()
    window.resize(*SIZE)
    return window
