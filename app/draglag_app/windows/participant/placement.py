"""Whether panel and participant's screen match."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QCoreApplication, Qt
from PySide6.QtGui import QScreen

from draglag.recording import Screen
from draglag_app.windows.settings import PanelSettings

# Pixels are square to better than this; a screen on its side differs by far more.
_SHAPE = 0.03


def tr(text: str) -> str:
    return QCoreApplication.translate("Placement", text)


def turned(screen: Screen) -> Screen:
    """The screen on its side."""
    return replace(
        screen, width_mm=screen.height_mm, height_mm=screen.width_mm, width_px=screen.height_px,
        height_px=screen.width_px,
    )  # fmt: skip


def turned_panel(panel: PanelSettings) -> PanelSettings:
    """The panel on its side, without beam and calibration, which no longer hold. Raises DataError."""
    screen = turned(panel.screen())
    sizes = {key: getattr(screen, key) for key in ("width_mm", "height_mm", "width_px", "height_px")}
    gone = {"beam_slope": 0.0, "beam_intercept_mm": None, "calibration": None}
    return panel.model_copy(update={**sizes, **gone})


def shape_problem(panel: Screen, shown_on: QScreen) -> str:
    """Why lengths would be wrong there, else empty."""
    size = shown_on.size()
    factor = (panel.width_mm / panel.height_mm) / (size.width() / size.height())
    if abs(factor - 1.0) <= _SHAPE:
        return ""
    numbers = {"w": size.width(), "h": size.height(), "mw": panel.width_mm, "mh": panel.height_mm}
    text = tr("The participant's screen shows {w}×{h} points, but the screen under test is {mw:.0f} × {mh:.0f} mm: ")
    upright = (panel.height_mm / panel.width_mm) / (size.width() / size.height())
    remedy = (
        tr("press Rotate 90° on the Geometry page.") if abs(upright - 1.0) <= _SHAPE else tr("correct the numbers.")
    )
    return text.format(**numbers) + remedy


def axes_problem(calibrated: bool, shown_on: QScreen) -> str:
    """Why touches would not match the picture, else empty.

    A desktop turns the picture, not the kernel's axes.
    """
    upright = shown_on.nativeOrientation()
    if upright == Qt.ScreenOrientation.PrimaryOrientation:
        upright = shown_on.primaryOrientation()
    if calibrated or shown_on.orientation() in (upright, Qt.ScreenOrientation.PrimaryOrientation):
        return ""
    return tr("The participant's screen is turned, the touchscreen's axes are not: calibrate it (Ctrl+K).")
