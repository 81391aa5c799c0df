"""Dark and light theme."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass

import pyqtgraph as pg
from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QApplication

from draglag_app.windows.parts.icons import icon_file
from draglag_resources import resource


@dataclass(frozen=True)
class Theme:
    """Colours by meaning; those of data are Okabe and Ito's, distinct with colour blindness."""

    name: str
    window: str
    panel: str
    raised: str
    line: str
    text: str
    muted: str
    accent: str
    on_accent: str
    ok: str
    warning: str
    bad: str
    blue: str
    orange: str
    green: str
    purple: str
    sky: str

    @property
    def series(self) -> tuple[str, ...]:
        """Colours of curves, most distinct first."""
        return self.blue, self.orange, self.green, self.purple, self.sky


DARK = Theme(
    "dark", "#14171c", "#1b1f26", "#272d37", "#39414e", "#e9edf2", "#9aa5b4", "#56b4e9", "#0b1117",
    "#2fc39a", "#e69f00", "#ff7a45", "#56b4e9", "#e69f00", "#2fc39a", "#d98cb9", "#8ecbf0",
)  # fmt: skip
LIGHT = Theme(
    "light", "#eef0f3", "#ffffff", "#e4e8ee", "#c3cad4", "#161b22", "#566170", "#0060a0", "#ffffff",
    "#007253", "#925600", "#a80f2e", "#0072b2", "#c46a00", "#00805e", "#a8437f", "#2a86b8",
)  # fmt: skip
THEMES = {theme.name: theme for theme in (DARK, LIGHT)}
_present = DARK
_scale = 1.0


def theme() -> Theme:
    """The present theme."""
    return _present


def wide(size_px: int) -> int:
    """A width for text of the chosen size."""
    return round(_scale * size_px)


def points(size: float) -> str:
    """A text size as "10pt", by the chosen text size."""
    return f"{_scale * size:g}pt"


def apply_theme(application: QApplication, name: str, scale: float | None = None) -> Theme:
    """The theme, applied; "system" follows the desktop."""
    global _present, _scale
    _scale = scale or _scale
    if name not in THEMES:
        name = "dark" if application.palette().color(QPalette.ColorRole.Window).lightness() < 128 else "light"
    _present = THEMES[name]
    _restyle(application, style_sheet(_present, _scale))
    pg.setConfigOptions(background=_present.panel, foreground=_present.muted, antialias=True)
    return _present


def _restyle(application: QApplication, sheet: str) -> None:
    if application.styleSheet() == sheet:
        return
    # From one sheet to another Qt works out the looks of everything several times over: without one in between, once.
    application.setStyleSheet("")
    if application.style().name() != "fusion":
        application.setStyle("Fusion")
    application.setPalette(_palette(_present))
    application.setStyleSheet(sheet)


def style_sheet(colours: Theme, scale: float = 1.0) -> str:
    """The style sheet, ``@name`` replaced and text scaled."""
    values = {key: str(value) for key, value in asdict(colours).items()}
    values |= {
        "arrow_down": icon_file("arrow", colours.muted),
        "arrow_up": icon_file("up", colours.muted),
        "check": icon_file("check", colours.on_accent),
    }
    text = resource("theme", "style.qss").read_text("utf-8")
    text = re.sub(r"@(\w+)", lambda match: values[match.group(1)], text)
    return re.sub(r"font-size: (\d+)px", lambda match: f"font-size: {round(scale * int(match.group(1)))}px", text)


def _palette(colours: Theme) -> QPalette:
    palette = QPalette()
    role = QPalette.ColorRole
    for which, colour in (
        (role.Window, colours.window),
        (role.WindowText, colours.text),
        (role.Base, colours.panel),
        (role.AlternateBase, colours.raised),
        (role.ToolTipBase, colours.raised),
        (role.ToolTipText, colours.text),
        (role.Text, colours.text),
        (role.Button, colours.raised),
        (role.ButtonText, colours.text),
        (role.PlaceholderText, colours.muted),
        (role.Highlight, colours.accent),
        (role.HighlightedText, colours.on_accent),
        (role.Link, colours.accent),
    ):
        palette.setColor(which, QColor(colour))
    for which in (role.WindowText, role.Text, role.ButtonText):
        palette.setColor(QPalette.ColorGroup.Disabled, which, QColor(colours.muted))
    return palette
