"""Results: the curve and its runs."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QCheckBox,
    QInputDialog,
    QLineEdit,
    QSplitter,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from draglag.analysis import Analysis
from draglag.curve import FORMS, CurveFit, fit_form
from draglag.errors import EstimateError
from draglag_app.windows.pages.parts.run_table import RunTable
from draglag_app.windows.pages.parts.width_view import WidthView
from draglag_app.windows.parts.flow import Flow
from draglag_app.windows.parts.full_texts import ElidedBox, whole_text
from draglag_app.windows.parts.tasks import Progress
from draglag_app.windows.parts.theme import wide
from draglag_app.windows.parts.widgets import LARGE_TEXT, button, label
from draglag_app.windows.plots.curve_plot import CurvePlot
from draglag_app.windows.plots.result_plots import AlignmentPlot, CostPlot, TapsPlot, ValidationView
from draglag_app.windows.wording import words
from draglag_app.windows.wording.equation import equation_html
from draglag_app.windows.wording.library_words import sentences
from draglag_app.windows.workspace import Workspace

_FILTER_PX = 260
_LETTERS = 9  # of a choice, at least
_RATES = (None, 60.0, 100.0, 120.0, 200.0)
_ALTERNATIVES = 4  # of the curve, likeliest first: colours, and names that a small window has room for


class ResultsPage(QWidget):
    """Curve, table of runs, and the selected run."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        self._chosen = ""
        self._alternatives: list[CurveFit] = []
        outer = QVBoxLayout(self)
        outer.setContentsMargins(12, 12, 12, 12)
        outer.setSpacing(8)
        self.summary = label("", "medium", wrap=True)
        outer.addWidget(self.summary)
        self.equation = label("", wrap=True)
        self.equation.setTextFormat(Qt.TextFormat.RichText)
        self.equation.setToolTip(self.tr("Every ± is half a 95 % interval"))
        self.equation.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        outer.addLayout(self._choices())
        outer.addWidget(self.equation)
        self.curve = CurvePlot()
        self.table = RunTable(browsed=True)
        self.table.run_selected.connect(self.choose)
        self.tabs = QTabWidget()
        self.tabs.setAccessibleName(self.tr("The chosen run"))
        self.alignment = AlignmentPlot()
        self.cost = CostPlot()
        self.width_view = WidthView(workspace)
        self.taps = TapsPlot()
        self.validation = ValidationView()
        for page, title in (
            (self.alignment, self.tr("Alignment")),
            (self.cost, self.tr("J(L)")),
            (self.width_view, self.tr("Width")),
            (self.taps, self.tr("Taps")),
            (self.validation, self.tr("Validation")),
        ):
            self.tabs.addTab(page, title)
        self.tabs.currentChanged.connect(lambda index: self._show_run())
        outer.addLayout(self._runs_row())
        outer.addWidget(self._parts(), 1)
        self.flags = label("", "hint", wrap=True)
        self.flags.hide()
        outer.addWidget(self.flags)
        workspace.session_changed.connect(self._session_changed)
        workspace.analysis_changed.connect(self._analysis_changed)
        workspace.comments_changed.connect(lambda: self.table.show_comments(workspace.comments))
        self._session_changed()
        self._analysis_changed()

    def _runs_row(self) -> Flow:
        row = Flow()
        self.filter = QLineEdit()
        self.filter.setAccessibleName(self.tr("Filter runs"))
        self.filter.setPlaceholderText(self.tr("Filter runs: words in any column"))
        self.filter.setClearButtonEnabled(True)
        self.filter.setMinimumWidth(wide(_FILTER_PX))
        self.filter.textChanged.connect(self.table.keep_those_with)
        row.addWidget(self.filter)
        self.comment = button(self.tr("Comment…"))
        self.comment.clicked.connect(self._ask_comment)
        row.add_rest()
        row.add_together(self.comment, self.exclude_button, self.keep)
        return row

    def _ask_comment(self) -> None:
        run = self._chosen
        if not run:
            return
        dialog = QInputDialog(self)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowModality(Qt.WindowModality.WindowModal)
        dialog.setWindowTitle(self.tr("Comment"))
        dialog.setLabelText(self.tr("Comment on {run}").format(run=run))
        dialog.setTextValue(self._space.comments.get(run, ""))
        dialog.textValueSelected.connect(lambda text: self._keep_comment(run, text.strip()))
        dialog.open()

    def _keep_comment(self, run: str, text: str) -> None:
        self._space.comment(run, text)
        self.table.bring_comment(run)

    def _parts(self) -> QSplitter:
        large = wide(100) > LARGE_TEXT
        within, across = Qt.Orientation.Vertical, Qt.Orientation.Horizontal
        inner = QSplitter(across if large else within)
        outer = QSplitter(within if large else across)
        inner.addWidget(self.curve)
        outer.addWidget(inner)
        if large:
            inner.addWidget(self.tabs)
            outer.addWidget(self.table)
            outer.setSizes([280, 200])
        else:
            inner.addWidget(self.table)
            inner.setSizes([330, 240])
            outer.addWidget(self.tabs)
        (inner if large else outer).setSizes([660, 440])  # verdicts of the usual length in sight
        return outer

    def _choices(self) -> Flow:
        row = Flow()
        self.estimator = ElidedBox(_LETTERS)
        self.estimator.addItem(self.tr("Efficient"), "efficient")
        self.estimator.addItem(self.tr("As published"), "paper")
        self.rate = ElidedBox(_LETTERS)
        for rate in _RATES:
            text = self.tr("Kernel stamps") if rate is None else self.tr("Sampled at {hz:.0f} Hz").format(hz=rate)
            self.rate.addItem(text, rate)
        self.form = ElidedBox(_LETTERS)
        self.form.addItem(self.tr("Best form"), "best")
        for name in FORMS:
            self.form.addItem(words.form_name(name), name)
        for box, tip in (
            (self.estimator, self.tr("How the latency of a run is estimated")),
            (
                self.rate,
                self.tr("Touch events as the kernel stamps them, or sampled by a program at that rate"),
            ),
            (self.form, self.tr("Shape of the curve")),
        ):
            whole_text(box, tip)
            box.setAccessibleName(tip)
            box.activated.connect(self._options_chosen)
            box.setMaximumWidth(box.whole_px())
            row.add_growing(box)
        self.fix_asymptote = QCheckBox(self.tr("Fix asymptote to taps"))
        self.fix_asymptote.setToolTip(self.tr("Fix the latency at high speed to the median release tap"))
        self.fix_asymptote.clicked.connect(self._options_chosen)
        row.addWidget(self.fix_asymptote)
        self.show_alternatives = QCheckBox(self.tr("Show alternative fits"))
        self.show_alternatives.clicked.connect(self._fit_alternatives)
        row.addWidget(self.show_alternatives)
        self.show_residuals = QCheckBox(self.tr("Show residuals"))
        self.show_residuals.setToolTip(self.tr("Latency less the curve: the 95 % band is wide enough to see there"))
        self.show_residuals.clicked.connect(self._draw_curve)
        row.addWidget(self.show_residuals)
        self.exclude_button = button(self.tr("Exclude…"))
        self.exclude_button.clicked.connect(self._toggle_chosen)
        self.keep = button(self.tr("Keep results"), tip=self.tr("Store them in the session's file"))
        self.keep.clicked.connect(self._space.keep_analysis)
        return row

    # --- the session ----------------------------------------------------------------------------------------

    def _session_changed(self) -> None:
        self._chosen, self._alternatives = "", []
        self.filter.clear()  # words for another session's runs would hide those of this one
        self.flags.hide()
        self.table.clear_runs()
        for plot in (self.curve, self.alignment, self.cost, self.taps):
            plot.clear_all()
        self.width_view.clear()
        self.validation.show_items(())
        session = self._space.session
        if session is not None:
            for run in session.runs:
                self.table.add_run(run, run.outcome)
        self._say()

    def _analysis_changed(self) -> None:
        analysis = self._space.analysis
        if analysis is None:
            return
        self._alternatives = []
        self.table.show_estimates(analysis.runs, analysis.options.exclude)
        by_hand = analysis.options.exclude
        self.table.show_repeated({run: by for run, by in analysis.repeated.items() if run not in by_hand})
        self.table.show_comments(self._space.comments)
        self._draw_curve()
        self.taps.show_taps(analysis.taps)
        self.width_view.show_analysis(analysis)
        self.validation.show_items(analysis.validation)
        self._say()
        self._name_button()
        if not self._chosen and analysis.runs:
            self.table.select(analysis.runs[0].id)
        self._show_run()
        if self.show_alternatives.isChecked():
            self._fit_alternatives()

    def _say(self) -> None:
        session, analysis = self._space.session, self._space.analysis
        curve = analysis.curve if analysis is not None else None
        self.equation.setText("" if curve is None else equation_html(curve))
        self.equation.setVisible(curve is not None)
        for widget in (
            self.comment,
            self.exclude_button,
            self.keep,
            self.estimator,
            self.rate,
            self.form,
            self.fix_asymptote,
            self.show_alternatives,
            self.show_residuals,
        ):
            widget.setEnabled(analysis is not None)
        if session is None:
            self.summary.setText(self.tr("No session yet. Measure one (F5), or open one (Ctrl+O)."))
        elif analysis is None:
            self.summary.setText(self.tr("Analysing {name} …").format(name=session.name))
        else:
            self.summary.setText(self._summary(analysis))

    def _summary(self, analysis: Analysis) -> str:
        curve = analysis.curve
        if curve is None:
            text = self.tr("{name}: no curve. ").format(name=analysis.session)
            return text + sentences((*analysis.problems, *analysis.warnings))
        low, high = curve.speed_range_mm_s
        text = self.tr(
            "{form}, {n} runs, {low:.0f}–{high:.0f} mm/s. RMS {rms:.2f} ms; cross-validated {held:.2f} ms."
        ).format(
            form=words.form_name(curve.form).capitalize(), n=curve.n_points, low=low, high=high,
            rms=1e3 * curve.rms_s, held=1e3 * curve.held_out_rms_s,
        )  # fmt: skip
        trouble = sentences((*analysis.problems, *analysis.warnings))
        return text + (f"  ▲ {trouble}" if trouble else "")

    def _draw_curve(self) -> None:
        analysis = self._space.analysis
        if analysis is not None:
            self.curve.draw(
                analysis.runs, analysis.curve, analysis.excluded, self._alternatives, self.table.select,
                self.show_residuals.isChecked(),
            )  # fmt: skip

    # --- choices --------------------------------------------------------------------------------------------

    def _options_chosen(self) -> None:
        self._space.set_options(
            replace(
                self._space.options,
                estimator=str(self.estimator.currentData()),
                update_rate_hz=self.rate.currentData(),
                form=str(self.form.currentData()),
                tie_asymptote=self.fix_asymptote.isChecked(),
            )
        )

    def _fit_alternatives(self) -> None:
        analysis = self._space.analysis
        if analysis is None or analysis.curve is None or not self.show_alternatives.isChecked():
            self._alternatives = []
            self._draw_curve()
            return
        points, present = analysis.curve.points, analysis.curve.form

        def work(progress: Progress) -> list[CurveFit]:
            made = []
            for name in FORMS:
                progress(0.0, name)
                try:
                    if points is not None and name != present:
                        made.append(fit_form(points, name))
                except EstimateError:
                    continue
            return sorted(made, key=lambda fit: fit.aicc)[:_ALTERNATIVES]

        def done(alternatives: list[CurveFit]) -> None:
            self._alternatives = alternatives
            self._draw_curve()

        self._space.tasks.start(self.tr("Fitting the alternatives"), work, done, lambda text: None)

    def _toggle_chosen(self) -> None:
        if not self._chosen:
            return
        if self._is_out():
            self._space.include(self._chosen)
            return
        asked = self.tr("Why is {run} excluded from the curve?").format(run=self._chosen)
        dialog = QInputDialog(self)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowModality(Qt.WindowModality.WindowModal)  # the participant's Esc still aborts a run
        dialog.setWindowTitle(self.tr("Exclude a run"))
        dialog.setLabelText(asked)
        run, none = self._chosen, self.tr("no reason given")
        dialog.textValueSelected.connect(lambda reason: self._space.exclude(run, reason.strip() or none))
        dialog.open()

    # --- the chosen run -------------------------------------------------------------------------------------

    def choose(self, run_id: str) -> None:
        """Show a run."""
        self._chosen = run_id
        self._name_button()
        self._show_run()

    def _is_out(self) -> bool:
        analysis = self._space.analysis
        return analysis is not None and self._chosen in analysis.excluded

    def _name_button(self) -> None:
        out = self._is_out()
        self.exclude_button.setText(self.tr("Include") if out else self.tr("Exclude…"))

    def _show_run(self) -> None:
        analysis, session = self._space.analysis, self._space.corrected
        if analysis is None or session is None or not self._chosen:
            return
        shown = self.tabs.currentWidget()
        estimate = next((e for e in analysis.runs if e.id == self._chosen), None)
        self.flags.setText("" if estimate is None else words.flag_meanings(estimate.flags))
        self.flags.setVisible(bool(self.flags.text()))
        checked = next((v for v in analysis.validation if v.run == self._chosen), None)
        if shown is self.alignment:
            self.alignment.show_run(estimate, checked)
        elif shown is self.cost and estimate is not None:
            self.cost.show_run(session.run(self._chosen), estimate, session.stylus.diameter_mm, self._space.tasks)

    def restyle_plots(self) -> None:
        """Draw in the present theme."""
        for plot in (self.curve, self.alignment, self.cost, self.width_view.plot, self.taps, self.validation.plot):
            plot.restyle()
        self._analysis_changed()
