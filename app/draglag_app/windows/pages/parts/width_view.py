"""The stylus' width and its diameter by ruler."""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication
from PySide6.QtWidgets import QDoubleSpinBox, QHBoxLayout, QVBoxLayout

from draglag.analysis import Analysis
from draglag_app.windows.parts.full_texts import ElidedLabel
from draglag_app.windows.parts.widgets import Scrolled, label
from draglag_app.windows.plots.result_plots import WidthPlot
from draglag_app.windows.workspace import Workspace


def tr(text: str) -> str:
    return QCoreApplication.translate("WidthView", text)


class WidthView(Scrolled):
    """A field that corrects the diameter the session was recorded with, and the plot."""

    def __init__(self, workspace: Workspace) -> None:
        name, diameter, plot = label(tr("Stylus diameter")), QDoubleSpinBox(), WidthPlot()
        diameter.setRange(0.5, 50.0)
        diameter.setDecimals(2)
        diameter.setSingleStep(0.1)
        diameter.setSuffix(" mm")
        diameter.setAccessibleName(tr("Stylus diameter"))
        name.setBuddy(diameter)
        recorded = ElidedLabel("hint")
        row, column = QHBoxLayout(), QVBoxLayout()
        for one in (name, diameter):
            row.addWidget(one)
        row.addWidget(recorded, 1)
        row.setContentsMargins(8, 6, 8, 0)
        column.addLayout(row)
        column.addWidget(plot, 1)
        super().__init__(column)
        self._space, self._shown_mm = workspace, 0.0
        self.plot, self.diameter, self.recorded = plot, diameter, recorded
        diameter.editingFinished.connect(self._edited)
        self.clear()

    def clear(self) -> None:
        """Show no session."""
        self.plot.clear_all()
        self._say("")
        self.diameter.setEnabled(False)

    def show_analysis(self, analysis: Analysis) -> None:
        """Show the widths of the session at hand."""
        corrected, recorded = self._space.corrected, self._space.session
        if corrected is None or recorded is None:
            return
        self.plot.show_runs(analysis.runs, corrected)
        self.diameter.setEnabled(True)
        self.diameter.setValue(corrected.stylus.diameter_mm)
        self._shown_mm = self.diameter.value()
        said = tr("recorded as {mm:.2f} mm").format(mm=recorded.stylus.diameter_mm)
        self._say(said if corrected is not recorded else "")

    def _say(self, recorded: str) -> None:
        self.recorded.setText(recorded)
        tip = tr(
            "For a session recorded with a wrong diameter; its file keeps that one. Latencies hardly depend on it, as "
            "the width is fitted in every run. It decides on the check against the ruler, on which changes of the "
            "light are bounces, on which runs lie too far off their lines, and on the gap."
        )
        self.diameter.setToolTip("\n".join(filter(None, (recorded, tip))))  # large letters leave no room next to it

    def _edited(self) -> None:
        recorded, entered_mm = self._space.session, self.diameter.value()
        if recorded is None or entered_mm == self._shown_mm:
            return  # with fewer digits than the diameter has, it is not another
        recorded_mm = recorded.stylus.diameter_mm
        self._space.correct_stylus(recorded_mm if entered_mm == round(recorded_mm, 2) else entered_mm)
