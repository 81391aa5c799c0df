"""Live plots of a run."""

from __future__ import annotations

import numpy as np
from PySide6.QtWidgets import QWidget

from draglag.protocol.runs import PlannedRun
from draglag_app.live import LiveRun
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.plots.plot import Plot, tr
from draglag_app.windows.recording.session_thread import Order

# More points than this cannot be distinguished on a screen, but cost time that the participant's target needs.
_MOST_DRAWN = 1500
# Around what a plot shows, as a share of it; and how much faster than the target a stylus may be and still be seen.
_MARGIN, _FASTER = 0.03, 1.35


def _thinned(table: np.ndarray) -> np.ndarray:
    step = max(1, -(-len(table) // _MOST_DRAWN))
    return table[::-1][::step][::-1]


class TracePlot(Plot):
    """Target's path, touch trace, beam, edges."""

    _begun: tuple[Order | None, PlannedRun | None] = (None, None)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("", tr("x (mm)"), tr("y (mm)"), "trace", parent)
        self.setAspectLocked(True)
        self.getPlotItem().vb.invertY(True)
        self._shown_mm = (0.0, 0.0)
        self.restyle()

    def restyle(self) -> None:
        super().restyle()
        self._draw_what_stands()
        marks = (
            ("▽", theme().orange, tr("beam blocked")),
            ("□", theme().purple, tr("beam clear")),
            ("╌", theme().bad, tr("beam")),
        )
        self.name_above(tr("On the screen"), marks)

    def begin(self, order: Order | None, planned: PlannedRun | None) -> None:
        """Draw a screen without touches."""
        self.clear_all()
        self._begun = (order, planned)
        self._draw_what_stands()
        if order is None:
            return
        screen = order.options.screen
        if self._shown_mm != (screen.width_mm, screen.height_mm):
            # Looking for the range each time, and drawing axes again for it, would cost the participant frames.
            self._shown_mm = (screen.width_mm, screen.height_mm)
            self.setRange(xRange=(0, screen.width_mm), yRange=(0, screen.height_mm), padding=_MARGIN)

    def _draw_what_stands(self) -> None:
        order, planned = self._begun
        if order is None:
            return
        colours, screen = theme(), order.options.screen
        x, y = np.array([0, 1, 1, 0, 0]) * screen.width_mm, np.array([0, 0, 1, 1, 0]) * screen.height_mm
        self.line(tr("screen"), x, y, colours.muted, 1, legend=False)
        beam = order.options.beam
        if beam is not None:
            across = np.array([0.0, screen.width_mm])
            self.line(tr("beam"), across, beam.slope * across + beam.intercept_mm, colours.bad, 1.5, dash=True)
        if planned is not None:
            t_s = np.linspace(0, planned.duration_s, _MOST_DRAWN)
            self.line(tr("target"), *planned.target.position_mm(t_s), colours.line, 1)

    def draw(self, live: LiveRun) -> None:
        """Draw the data so far."""
        colours, trace = theme(), live.trace()
        if not len(trace):
            return
        thin = _thinned(trace)
        if self._shown_mm != (0.0, 0.0) and _beyond(thin[:, 1:], self._shown_mm):
            # Touches that are not on the screen are there to be seen, too.
            self._shown_mm = (0.0, 0.0)
            self.enableAutoRange()
        self.line(tr("touch"), thin[:, 1], thin[:, 2], colours.blue, 1)
        self.dots(tr("stylus"), trace[-1:, 1], trace[-1:, 2], colours.text, "+", 16, legend=False)
        edges = live.edges_on_screen()
        for name, light, symbol, colour in (
            (tr("beam blocked"), 0, "t", colours.orange),
            (tr("beam clear"), 1, "s", colours.purple),
        ):
            chosen = edges[edges[:, 2] == light]
            if len(chosen):
                self.dots(name, chosen[:, 0], chosen[:, 1], colour, symbol, 8, hollow=True)


class SpeedPlot(Plot):
    """Speed of stylus and target."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("", tr("time in the run (s)"), tr("speed (mm/s)"), "speed", parent)
        self.restyle()

    def restyle(self) -> None:
        super().restyle()
        self.name_above(tr("Speed"), (("╌", theme().muted, tr("target")), ("─", theme().blue, tr("stylus"))))
        for name, columns in list(self.drawn.items()):
            self._draw_line(name, *columns)

    def begin(self, planned: PlannedRun | None) -> None:
        """Draw the target's speed."""
        self.clear_all()
        if planned is None:
            return
        t_s = np.linspace(0, planned.duration_s, 800)
        target = np.hypot(*planned.target.velocity_mm_s(t_s))
        self._draw_line(tr("target"), t_s, target)
        fastest = max(1.0, float(target.max()))
        self.setRange(xRange=(0, planned.duration_s), yRange=(0, _FASTER * fastest), padding=_MARGIN)

    def draw(self, live: LiveRun) -> None:
        """Draw the data so far."""
        speed = live.speeds()
        if live.planned is None or not len(speed):
            return
        thin = _thinned(speed)
        self._draw_line(tr("stylus"), thin[:, 0], thin[:, 1])

    def _draw_line(self, name: str, t_s: np.ndarray, speed_mm_s: np.ndarray) -> None:
        target = name == tr("target")
        self.line(name, t_s, speed_mm_s, theme().muted if target else theme().blue, 2 if target else 1, dash=target)


def _beyond(places_mm: np.ndarray, screen_mm: tuple[float, float]) -> bool:
    spare = _MARGIN * np.array(screen_mm)
    return bool(((places_mm < -spare) | (places_mm > screen_mm + spare)).any())
