"""A protocol's duration and order."""

from __future__ import annotations

from html import escape

import numpy as np
from PySide6.QtCore import QObject, Qt

from draglag.errors import DraglagError
from draglag.protocol.runs import PlannedRun, expand, first_target_after_s, session_duration_s
from draglag_app.session.options import COUNTDOWN_S
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.parts.widgets import label, restyle
from draglag_app.windows.plots.plot import Plot, tr
from draglag_app.windows.wording import words
from draglag_app.windows.wording.library_words import in_words
from draglag_app.windows.workspace import Workspace


class PlanPreview(QObject):
    """Words, and a plot of speed against session time."""

    def __init__(self, workspace: Workspace, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        self._key = ""
        self.words = label("", "verdict", wrap=True)
        self.words.setTextFormat(Qt.TextFormat.RichText)
        self.plot = Plot(
            tr("Order of the runs"), tr("time in the session (min)"), tr("target speed (mm/s)"), "protocol"
        )
        workspace.settings_changed.connect(self.refresh)

    def refresh(self) -> None:
        """Show the protocol on the present screen."""
        protocol, panel = self._space.protocol, self._space.settings.panel
        self.plot.clear_all()
        try:
            plan = expand(protocol, panel.screen(), beam=panel.beam())
        except DraglagError as error:
            self.words.setText(escape(in_words(error.message)))
            restyle(self.words, "level", "bad")
            return
        restyle(self.words, "level", "")
        self._draw(plan)
        total_s = session_duration_s(protocol, plan, COUNTDOWN_S)
        text = self.tr("{n} runs, about {time} in all").format(n=len(plan), time=words.duration(total_s))
        if plan:
            after_s = first_target_after_s(protocol, COUNTDOWN_S)
            text += self.tr(", the first target after {time}").format(time=words.duration(after_s))
        notes = sorted({in_words(planned.note) for planned in plan if planned.note})
        # What the colours mean stands here: above the plot there is no room for it.
        self.words.setText(escape(text + "".join(f". {note}" for note in notes)) + self._key)

    def _draw(self, plan: tuple[PlannedRun, ...]) -> None:
        at_s, rest_s = 0.0, self._space.protocol.rest_s
        parts: dict[str, list[np.ndarray]] = {}
        for planned in plan:
            t_s = np.linspace(0, planned.duration_s, 300)
            speed = np.hypot(*planned.target.velocity_mm_s(t_s))
            if planned.nominal_speed_mm_s is not None:
                speed = np.full(t_s.shape, planned.nominal_speed_mm_s)
            piece = np.column_stack([(at_s + t_s) / 60, speed])
            parts.setdefault(planned.kind, []).append(np.vstack([piece, [np.nan, np.nan]]))
            at_s += planned.duration_s + rest_s + COUNTDOWN_S
        colours = dict(zip(("circle", "chirp", "multisine", "step"), theme().series, strict=False))
        for kind, pieces in parts.items():
            table = np.vstack(pieces)
            width = 4 if kind == "circle" else 1.2
            colour = colours.get(kind, theme().text)
            self.plot.line(words.target_name(kind), table[:, 0], table[:, 1], colour, width, legend=False)
        self._key = "".join(
            # The square and its words stay in one line.
            f" &nbsp; <span style='color:{colours.get(kind, theme().text)}'>■</span>"
            + f" {words.target_name(kind)}".replace(" ", "&nbsp;")
            for kind in parts
        )
        self.plot.autoRange(padding=0.04)

    def restyle_plots(self) -> None:
        """Draw in the present theme."""
        self.plot.restyle()
        self.refresh()
