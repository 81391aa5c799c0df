"""The expected precision of latencies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PySide6.QtCore import QTimer
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from draglag.analysis.planning import Plan, PlannedPrecision, plan
from draglag.errors import DraglagError
from draglag.protocol.runs import Protocol
from draglag.simulation import Rig, rig_for_screen
from draglag_app.windows.parts.tasks import Task, Tasks
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.parts.widgets import label, restyle
from draglag_app.windows.plots.plot import Plot, tr
from draglag_app.windows.wording.library_words import in_words
from draglag_app.windows.workspace import Workspace

# Edits come in flurries; the prediction waits for the last of them.
_PAUSE_MS = 500
_MOST_REMEMBERED = 2000


class PrecisionPreview(QWidget):
    """Half the 95 % interval against speed, predicted while visible and not recording."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        self._tasks: Tasks = workspace.quiet_tasks
        self._task: Task | None = None
        self._known: dict[str, PlannedPrecision] = {}
        self._wanted: tuple[Protocol, Rig] | None = None
        self._shown: tuple[Protocol, Rig] | None = None
        self.plan: Plan | None = None
        box = QVBoxLayout(self)
        box.setContentsMargins(0, 0, 0, 0)
        self.plot = Plot(tr("Predicted precision"), tr("drag speed (mm/s)"), tr("95 % interval (± ms)"), "precision")
        self.plot.add_legend()
        self.words = label("", "hint", wrap=True)
        box.addWidget(self.plot, 1)
        self._pause = QTimer(self)
        self._pause.setSingleShot(True)
        self._pause.setInterval(_PAUSE_MS)
        self._pause.timeout.connect(self._begin)
        workspace.settings_changed.connect(self.refresh)
        workspace.protocol_changed.connect(self.refresh)
        workspace.recording.began.connect(lambda order: self._give_way())
        workspace.recording.ended.connect(lambda path, problem: self.refresh())

    def refresh(self) -> None:
        """Predict again, after a delay, if anything changed."""
        if not self.isVisible() or self._space.recording.active:
            return
        panel = self._space.settings.panel
        try:
            rig = replace(rig_for_screen(panel.preset), screen=panel.screen(), stylus=panel.stylus())
        except DraglagError as error:
            self._say(in_words(error.message), "bad")
            return
        beam = panel.beam()
        wanted = self._space.protocol, rig if beam is None else replace(rig, beam=beam)
        if wanted == self._shown and self._task is None:
            return
        if wanted != self._wanted or self._task is None:
            self._give_way()
            self._wanted = wanted
            self._pause.start()

    def _give_way(self) -> None:
        self._pause.stop()
        self._wanted = None
        if self._task is not None:
            self._task.cancel()
            self._task = None

    def _begin(self) -> None:
        if self._wanted is None:
            return
        (protocol, rig), known = self._wanted, self._known
        if len(known) > _MOST_REMEMBERED:
            known.clear()
        self.plot.say_empty(self.tr("Predicting the precision…"))
        self._say(self.tr("Predicting the precision…"))
        self._task = self._tasks.start(
            "", lambda progress: plan(protocol, rig, progress=progress, known=known), self._predicted, self._failed
        )

    def _predicted(self, found: Plan) -> None:
        self._task, self._shown, self.plan = None, self._wanted, found
        self._draw()

    def _failed(self, text: str) -> None:
        self._task, self._shown, self.plan = None, self._wanted, None
        self.plot.clear_all()
        self.plot.say_empty()
        self._say(in_words(text), "bad")

    def _draw(self) -> None:
        found, colours = self.plan, theme()
        self.plot.clear_all()
        if found is None:
            return
        sure = [run for run in found.runs if np.isfinite(run.se_s)]
        speed, half_ms = (
            np.array(column)
            for column in ([r.nominal_speed_mm_s for r in sure], [1e3 * r.half_interval_s for r in sure])
        )
        words = [
            tr("{id}: {speed:.0f} mm/s, {n} edges\n± {half:.2f} ms").format(
                id=run.id, speed=run.nominal_speed_mm_s, n=run.n_edges, half=1e3 * run.half_interval_s
            )
            for run in sure
        ]
        self.plot.dots(tr("runs"), speed, half_ms, colours.blue, words=words)
        if found.curve_se_s is not None:
            self.plot.line(tr("curve"), found.speed_mm_s, 1.96e3 * found.curve_se_s, colours.orange, 2)
        if len(half_ms):
            self.plot.setYRange(0, 1.1 * float(half_ms.max()), padding=0)
        self._tell(found, sure)

    def _tell(self, found: Plan, sure: list[PlannedPrecision]) -> None:
        if not sure:
            self._say(self.tr("No circle of this protocol will give a latency: let runs last longer."), "warning")
            return
        best: dict[float, float] = {}
        for run in sure:
            best[run.nominal_speed_mm_s] = min(best.get(run.nominal_speed_mm_s, np.inf), 1e3 * run.half_interval_s)
        each = " · ".join(f"{speed:.0f}:\u00a0{half:.2f}" for speed, half in sorted(best.items()))
        text = self.tr("Predicted ± ms (95 %) at each speed in mm/s: {each}.").format(each=each)
        if found.curve_se_s is None:
            text += " " + self.tr("For the ± of the curve plan at least six speeds.")
        unsure = len(found.runs) - len(sure)
        if unsure:
            text += " " + self.tr("{n} runs have too few edges.").format(n=unsure)
        self._say(text, "warning" if unsure or found.curve_se_s is None else "")

    def _say(self, text: str, level: str = "") -> None:
        self.words.setText(text)
        restyle(self.words, "level", level)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.refresh()

    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self._give_way()

    def restyle_plots(self) -> None:
        """Draw in the present theme."""
        self.plot.restyle()
        self._draw()
