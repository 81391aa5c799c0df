"""The steps to a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QCoreApplication, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QSizePolicy

from draglag_app.windows.actions import say
from draglag_app.windows.parts.full_texts import ElidedButton
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.parts.widgets import restyle
from draglag_app.windows.start import Obstacle
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP

STEPS = {
    "bench": QT_TRANSLATE_NOOP("Actions", "Bench"),
    "geometry": QT_TRANSLATE_NOOP("Actions", "Geometry"),
    "protocol": QT_TRANSLATE_NOOP("Actions", "Protocol"),
    "record": QT_TRANSLATE_NOOP("Actions", "Record"),
}


def tr(text: str) -> str:
    return QCoreApplication.translate("Steps", text)


@dataclass(frozen=True)
class Step:
    """One step; ``missing``: empty when done; ``blocks``: needed to record; ``next``: to do now."""

    page: str
    missing: str = ""
    blocks: bool = False
    next: bool = False


def steps_of(found: Sequence[Obstacle], faults: Sequence[str]) -> tuple[Step, ...]:
    """The four steps; ``faults``: of instruments."""
    made = []
    for page in STEPS:
        here = [obstacle for obstacle in found if page == (obstacle.page if obstacle.page in STEPS else "record")]
        missing = [obstacle.short for obstacle in here]
        if page == "bench" and faults:
            missing.append(tr("an instrument is at fault"))
        made.append(Step(page, ", ".join(missing), any(obstacle.hopeless for obstacle in here)))
    if any(step.missing for step in made[:-1]):
        blocks = any(step.blocks for step in made)
        made[-1] = Step("record", tr("waits for the steps before") if blocks else tr("see the steps before"), blocks)
    elif not made[-1].missing:
        made[-1] = Step("record", tr("press Start"), next=True)
    return tuple(made)


class StepGuide(QFrame):
    """A button per step: "✓ Bench", "1 Bench: choose touchscreen". ``chosen``: the page."""

    chosen = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("steps")
        self.setAccessibleName(tr("Steps to a measurement"))
        row = self.row = QHBoxLayout(self)
        row.setContentsMargins(12, 4, 12, 4)
        row.setSpacing(8)
        self.buttons: dict[str, ElidedButton] = {}
        for page in STEPS:
            made = self.buttons[page] = ElidedButton()
            made.setObjectName("step")
            # As wide as there is room; the tip has all of it.
            made.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
            made.clicked.connect(lambda checked=False, page=page: self.chosen.emit(page))
            row.addWidget(made, 1)

    def show_steps(self, steps: Sequence[Step], present: str) -> None:
        """Show the steps; ``present``: the page shown."""
        for number, step in enumerate(steps, 1):
            made, name = self.buttons[step.page], say(STEPS[step.page])
            done = not step.missing
            text = f"✓ {name}" if done else f"{number} {name}: {step.missing}"
            made.setText(text)
            made.setToolTip(plain(text))
            made.setAccessibleName(f"{name}: {tr('done') if done else step.missing}")
            state = "next" if step.next else "blocked" if step.blocks else "open"
            restyle(made, "state", "done" if done else state)
            restyle(made, "present", "true" if step.page == present else "false")
            self.row.setStretchFactor(made, made.sizeHint().width())  # each as wide as its words need
