"""Text can be read in both themes: contrast as WCAG 2 computes it, 4.5 to 1, of what is disabled 3 to 1."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import pyqtgraph as pg
import pytest
from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QApplication

from draglag_app.windows.participant.window import BACKGROUND, INK, PRACTICE, TARGET
from draglag_app.windows.parts.theme import THEMES, Theme, apply_theme, style_sheet
from draglag_app.windows.plots.plot_frame import PlotFrame
from draglag_app.windows.window import OperatorWindow

TEXT, DISABLED, DRAWN = 4.5, 3.0, 3.0
"""Least contrasts of text (level AA), of disabled text, and of lines and points (success criterion 1.4.11)."""
# Parts of controls that hold no text.
WITHOUT_TEXT = ("::chunk", "::indicator", "::handle", "::separator", "QSplitter", "QScrollBar", "QProgressBar")

both_themes = pytest.mark.parametrize("colours", THEMES.values(), ids=list(THEMES))


def luminance(colour: QColor) -> float:
    """Relative luminance of WCAG 2."""
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
        for part in (colour.redF(), colour.greenF(), colour.blueF())
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: QColor | str, other: QColor | str) -> float:
    low, high = sorted((luminance(QColor(one)), luminance(QColor(other))))
    return (high + 0.05) / (low + 0.05)


def surfaces(colours: Theme) -> tuple[str, ...]:
    """What text without a ground of its own stands on."""
    return colours.window, colours.panel, colours.raised


def rules(colours: Theme) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Selector, colour of the text, and what it may stand on, of each rule of the style sheet."""
    for selector, body in re.findall(r"([^{}]+){([^{}]*)}", style_sheet(colours)):
        given = dict(re.findall(r"(?:^|;|\s)(color|background): (#\w{6})", body))
        if given and not any(part in selector for part in WITHOUT_TEXT):
            grounds = (given["background"],) if "background" in given else surfaces(colours)
            yield selector.strip(), given.get("color", colours.text), grounds


def test_contrast_is_that_of_the_standard() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)  # as the standard's own tools give it


@both_themes
def test_text_of_every_rule_of_the_style_sheet_can_be_read(colours: Theme) -> None:
    found = {
        (selector, text, ground): round(contrast(text, ground), 2)
        for selector, text, grounds in rules(colours)
        for ground in grounds
        if contrast(text, ground) < (DISABLED if ":disabled" in selector else TEXT)
    }
    assert found == {}
    assert len(list(rules(colours))) > 40


@both_themes
def test_text_the_program_colours_itself_can_be_read(colours: Theme) -> None:
    """Verdicts, notices, links, cells."""
    for text in (colours.text, colours.muted, colours.ok, colours.warning, colours.bad, colours.accent):
        for ground in surfaces(colours):
            assert contrast(text, ground) >= TEXT, (text, ground)
    assert contrast(colours.on_accent, colours.accent) >= TEXT  # chosen rows and the main button


@both_themes
def test_what_is_drawn_is_seen_on_a_plots_ground(colours: Theme) -> None:
    for colour in (*colours.series, colours.bad, colours.muted):
        assert contrast(colour, colours.panel) >= DRAWN, colour


@pytest.mark.parametrize("name", list(THEMES))
def test_the_palette_can_be_read(qapp: QApplication, name: str) -> None:
    """Of what the style sheet does not name, as menus of the desktop and dialogs."""
    apply_theme(qapp, name)
    palette, role = qapp.palette(), QPalette.ColorRole
    pairs = ((role.WindowText, role.Window), (role.Text, role.Base), (role.ButtonText, role.Button),
             (role.ToolTipText, role.ToolTipBase), (role.HighlightedText, role.Highlight))  # fmt: skip
    for group, least in ((QPalette.ColorGroup.Active, TEXT), (QPalette.ColorGroup.Disabled, DISABLED)):
        for text, ground in pairs:
            assert contrast(palette.color(group, text), palette.color(group, ground)) >= least, (group, text)
    assert contrast(palette.color(role.PlaceholderText), palette.color(role.Base)) >= TEXT
    assert contrast(palette.color(role.Link), palette.color(role.Base)) >= TEXT
    apply_theme(qapp, "dark")


def labels(plot: PlotFrame) -> Iterator[tuple[str, QColor]]:
    """Words of a plot and their colours: axes, their numbers, title, legend, marks."""
    item = plot.getPlotItem()
    for side in ("bottom", "left"):
        axis = item.getAxis(side)
        yield "numbers", axis.textPen().color()
        yield axis.labelText, QColor(re.findall(r"color:\s*(#\w{6})", axis.label.toHtml())[-1])
    if item.titleLabel.text:
        yield item.titleLabel.text, QColor(item.titleLabel.opts["color"])
    for _, name in plot.legend.items if plot.legend is not None else ():
        yield name.text, QColor(name.opts["color"])
    for one in item.items:
        if isinstance(one, pg.InfiniteLine) and hasattr(one, "label"):
            yield one.label.format, QColor(one.label.color)


@pytest.mark.parametrize("name", list(THEMES))
def test_every_word_of_every_plot_can_be_read(
    opened: OperatorWindow, until: Callable, qapp: QApplication, name: str
) -> None:
    opened.pages.make_all()
    opened.use_theme(name)
    opened.go("results")
    results = opened.pages["results"][1]
    seen = set()
    for k in range(results.tabs.count()):
        results.tabs.setCurrentIndex(k)
        results.table.selectRow(1)
        until(lambda: not opened.space.tasks.running)
        for plot in opened.findChildren(PlotFrame):
            for words, colour in labels(plot):
                assert contrast(colour, THEMES[name].panel) >= TEXT, (plot.file_name, words, colour.name())
                seen.add(words)
    assert {"numbers", "drag speed (mm/s)"} <= seen
    assert any(words.endswith(" ms") for words in seen)  # the mark of the estimate
    opened.use_theme("dark")


def test_what_the_participant_sees_can_be_read() -> None:
    for colour in (INK, PRACTICE, TARGET):
        assert contrast(colour, BACKGROUND) >= TEXT
