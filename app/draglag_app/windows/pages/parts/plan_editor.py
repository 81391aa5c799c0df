"""The numbers of one table of a protocol."""

from __future__ import annotations

import re
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QCheckBox, QDoubleSpinBox, QLineEdit, QSpinBox, QWidget

from draglag.protocol.runs import RunPlan
from draglag_app.windows.parts.widgets import Form, Panel, label, restyle
from draglag_app.windows.wording import words

_USUAL_S = {"chirp": 80.0, "multisine": 45.0}


class PlanEditor(Panel):
    """Fields of one table; ``changed(plan)`` is emitted for valid numbers."""

    changed = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(" ", parent)
        self._plan: RunPlan | None = None
        self._filling = False
        form = Form()
        self._form = form
        self.speeds = QLineEdit()
        self.speeds.setPlaceholderText("44, 100, 300")
        self.radius = _number(1, 50, 1, " %")
        self.peak = _number(1, 50, 1, " %")
        self.step = _number(1, 89, 1, " %")
        self.duration = _number(1, 3600, 1, " s")
        self.sideways = _number(0, 500, 1, " px/s")
        self.repeats = QSpinBox()
        self.repeats.setRange(1, 100)
        self.practice = QCheckBox(self.tr("practice: not for the curve"))
        self._rows = (
            (self.tr("Speeds (mm/s)"), self.speeds, ("circle",)),
            (self.tr("Radius (% of width)"), self.radius, ("circle", "chirp")),
            (self.tr("Peak (% of height)"), self.peak, ("multisine",)),
            (self.tr("Step (% of height)"), self.step, ("step",)),
            (self.tr("Duration of each"), self.duration, ("circle", "chirp", "multisine", "step")),
            (self.tr("Sideways"), self.sideways, ("circle", "chirp", "multisine", "step")),
            (self.tr("Repeats"), self.repeats, ("circle", "chirp", "multisine", "step")),
            ("", self.practice, ("circle", "chirp", "multisine", "step")),
        )
        for text, field, _ in self._rows:
            form.row(text, field)
        self.body.addLayout(form)
        self.fault = label("", "verdict", wrap=True)
        restyle(self.fault, "level", "bad")
        self.body.addWidget(self.fault)
        self.speeds.editingFinished.connect(self._edited)
        for spin in (self.radius, self.peak, self.step, self.duration, self.sideways, self.repeats):
            spin.setKeyboardTracking(False)
            spin.valueChanged.connect(self._edited)
        self.practice.clicked.connect(self._edited)

    def show_plan(self, plan: RunPlan | None) -> None:
        """Show a table's numbers; None: nothing."""
        self._plan = plan
        self.setEnabled(plan is not None)
        self.fault.setText("")
        restyle(self.speeds, "fault", "false")
        if plan is None:
            self.title.setText(self.tr("No runs chosen"))
            return
        self._filling = True
        self.title.setText(words.target_name(plan.kind).capitalize())
        for _, field, kinds in self._rows:
            self._form.setRowVisible(field, plan.kind in kinds)
        self.speeds.setText(", ".join(f"{speed:g}" for speed in plan.all_speeds_mm_s if speed is not None))
        self.speeds.setCursorPosition(0)  # long lists show how they begin
        self.radius.setValue(100 * plan.radius_fraction)
        self.peak.setValue(100 * plan.peak_fraction)
        self.step.setValue(100 * plan.step_fraction)
        self.duration.setValue(plan.duration_s or _USUAL_S.get(plan.kind, 40.0))
        self.sideways.setValue(plan.sideways_px_s)
        self.repeats.setValue(plan.repeats)
        self.practice.setChecked(plan.practice)
        self._filling = False

    def _edited(self) -> None:
        if self._plan is None or self._filling:
            return
        changes: dict[str, Any] = {
            "radius_fraction": round(self.radius.value() / 100, 6),
            "peak_fraction": round(self.peak.value() / 100, 6),
            "step_fraction": round(self.step.value() / 100, 6),
            "duration_s": self.duration.value(),
            "sideways_px_s": self.sideways.value(),
            "repeats": self.repeats.value(),
            "practice": self.practice.isChecked(),
        }
        if self._plan.kind == "circle":
            changes |= {"speed_mm_s": None, "speeds_mm_s": re.split(r"[,;\s]+", self.speeds.text().strip(" ,;"))}
        try:
            plan = RunPlan.model_validate({**self._plan.model_dump(), **changes})
        except ValueError:
            self.fault.setText(self.tr("Speeds are numbers above 0 with commas between."))
            restyle(self.speeds, "fault", "true")
            return
        self.fault.setText("")
        restyle(self.speeds, "fault", "false")
        self.changed.emit(plan)


def _number(low: float, high: float, step: float, unit: str) -> QDoubleSpinBox:
    box = QDoubleSpinBox()
    box.setRange(low, high)
    box.setDecimals(1)
    box.setSingleStep(step)
    box.setSuffix(unit)
    return box
