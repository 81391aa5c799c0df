"""The stylus' width and its diameter by ruler."""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication
from PySide6.QtWidgets import QDoubleSpinBox, QVBoxLayout, QWidget

from draglag.analysis import Analysis
from draglag_app.windows.parts.flow import Flow
from draglag_app.windows.parts.widgets import label
from draglag_app.windows.plots.result_plots import WidthPlot
from draglag_app.windows.workspace import Workspace


def tr(text: str) -> str:
    return QCoreApplication.translate("WidthView", text)


class WidthView(QWidget):
    """The plot, and a field that corrects the diameter the session was recorded with."""

    def __init__(self, workspace: Workspace) -> None:
        super().__init__()
        self._space = workspace
        self.plot = WidthPlot()
        column = QVBoxLayout(self)
        column.setContentsMargins(8, 0, 8, 4)
        column.addWidget(self.plot, 1)
        self.diameter = QDoubleSpinBox()
        self.diameter.setRange(0.5, 50.0)
        self.diameter.setDecimals(2)
        self.diameter.setSingleStep(0.1)
        self.diameter.setSuffix(" mm")
        self.diameter.setKeyboardTracking(False)
        name = label(tr("Stylus diameter"))
        name.setBuddy(self.diameter)
        self.diameter.setAccessibleName(tr("Stylus diameter"))
        self.diameter.setToolTip(
            tr(
                "For a session recorded with a wrong diameter; its file keeps that one. Latencies hardly depend on "
                "it, as the width is fitted in every run. It decides on the check against the ruler, on which changes "
                "of the light are bounces, on which runs lie too far off their lines, and on the gap."
            )
        )
        self.recorded = label("", "hint")
        row = Flow()
        row.add_together(name, self.diameter)
        row.addWidget(self.recorded)
        column.addLayout(row)
        self.diameter.editingFinished.connect(self._edited)
        self.clear()

    def clear(self) -> None:
        """Show no session."""
        self.plot.clear_all()
        self.recorded.setText("")
        self.diameter.setEnabled(False)

    def show_analysis(self, analysis: Analysis) -> None:
        """Show the widths of the session at hand."""
        corrected, recorded = self._space.corrected, self._space.session
        if corrected is None or recorded is None:
            return
        self.plot.show_runs(analysis.runs, corrected)
        self.diameter.setEnabled(True)
        self.diameter.setValue(corrected.stylus.diameter_mm)
        said = tr("recorded as {mm:.2f} mm").format(mm=recorded.stylus.diameter_mm)
        self.recorded.setText(said if corrected is not recorded else "")

    def _edited(self) -> None:
        corrected, recorded = self._space.corrected, self._space.session
        entered_mm = self.diameter.value()
        if corrected is None or recorded is None or entered_mm == round(corrected.stylus.diameter_mm, 2):
            return  # shown with fewer digits than it has, it is not another
        recorded_mm = recorded.stylus.diameter_mm
        self._space.correct_stylus(recorded_mm if entered_mm == round(recorded_mm, 2) else entered_mm)
