"""Geometry: screen, stylus and beam in mm."""

from __future__ import annotations

import numpy as np
from PySide6.QtGui import QGuiApplication, QScreen
from PySide6.QtWidgets import QDoubleSpinBox, QHBoxLayout, QSpinBox, QVBoxLayout, QWidget

from draglag.errors import DraglagError
from draglag.protocol.presets import load_screen_file
from draglag.recording import Screen
from draglag_app.windows.pages.parts.calibration_panel import CalibrationPanel
from draglag_app.windows.participant.placement import shape_problem, turned_panel
from draglag_app.windows.participant.ruler import BAR_MM, RulerWindow
from draglag_app.windows.parts.flow import Flow
from draglag_app.windows.parts.full_texts import ElidedBox, whole_text
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.parts.widgets import Form, Panel, Scrolled, button, label, restyle
from draglag_app.windows.plots.plot import Plot, tr
from draglag_app.windows.settings import CalibrationSettings, PanelSettings
from draglag_app.windows.wording.library_words import in_words
from draglag_app.windows.workspace import Edit, Workspace
from draglag_resources import presets

_DISAGREE = 0.02


class GeometryPage(QWidget):
    """Numbers, and a drawing true to scale."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        self._ruler: RulerWindow | None = None
        row = QHBoxLayout(self)
        row.setContentsMargins(16, 16, 16, 16)
        row.setSpacing(12)
        left = QVBoxLayout()
        left.setSpacing(12)
        left.addWidget(self._numbers())
        left.addWidget(self._checks())
        left.addStretch(1)
        row.addWidget(Scrolled(left), 6)  # so wide that the ruler check is one row at 1280 px
        self.plot = Plot(self.tr("The screen, true to scale"), tr("x (mm)"), tr("y (mm)"), "geometry")
        self.plot.setAspectLocked(True)
        self.plot.getPlotItem().vb.invertY(True)
        right = QVBoxLayout()
        right.setSpacing(12)
        right.addWidget(self.plot, 3)
        self.calibration = CalibrationPanel(workspace, self._calibrated)
        right.addWidget(self.calibration, 5)
        row.addLayout(right, 5)
        workspace.settings_changed.connect(self.refresh)
        self.refresh()

    def _numbers(self) -> Panel:
        panel = Panel(self.tr("Screen under test"))
        form = Form()
        self.preset = ElidedBox(12)
        for name in presets("screens"):
            self.preset.addItem(f"{name}  ({load_screen_file(name).description})", name)
        whole_text(self.preset)
        self.preset.activated.connect(self._preset_chosen)
        form.row(self.tr("Preset"), self.preset)
        self.fields: dict[str, QDoubleSpinBox | QSpinBox] = {}
        for key, title, low, high, digits, unit in (
            ("width_mm", self.tr("Screen width"), 10.0, 5000.0, 1, " mm"),
            ("height_mm", self.tr("Screen height"), 10.0, 5000.0, 1, " mm"),
            ("width_px", self.tr("Pixels across"), 100, 20000, 0, " px"),
            ("height_px", self.tr("Pixels down"), 100, 20000, 0, " px"),
            ("stylus_mm", self.tr("Stylus diameter"), 0.5, 50.0, 2, " mm"),
            ("beam_intercept_mm", self.tr("Beam at the left edge"), -500.0, 5000.0, 1, " mm"),
            ("beam_slope", self.tr("Beam slope"), -1.0, 1.0, 4, " mm/mm"),
        ):
            field: QDoubleSpinBox | QSpinBox
            if digits:
                decimal = QDoubleSpinBox()
                decimal.setRange(low, high)
                decimal.setDecimals(digits)
                decimal.setSingleStep(0.001 if key == "beam_slope" else 0.1)
                field = decimal
            else:
                whole = QSpinBox()
                whole.setRange(int(low), int(high))
                field = whole
            field.setSuffix(unit)
            field.setKeyboardTracking(False)
            field.editingFinished.connect(self._numbers_edited)
            self.fields[key] = field
            form.row(title, field)
        panel.body.addLayout(form)
        self.simulated = label("", "hint", wrap=True)
        panel.body.addWidget(self.simulated)
        return panel

    def _checks(self) -> Panel:
        panel = Panel(self.tr("Ruler check"))
        self.verdict = label("", "verdict", wrap=True)
        panel.body.addWidget(self.verdict)
        text = self.tr("Show a bar of {mm:.0f} mm on the screen under test and lay a ruler on it.").format(mm=BAR_MM)
        panel.body.addWidget(label(text, "hint", wrap=True))
        row = Flow()
        self.show_bar = button(self.tr("Show the bar"))
        self.show_bar.clicked.connect(self._toggle_ruler)
        row.addWidget(self.show_bar)
        self.measured = QDoubleSpinBox()
        self.measured.setAccessibleName(self.tr("Measured length"))
        self.measured.setRange(10, 1000)
        self.measured.setDecimals(1)
        self.measured.setValue(BAR_MM)
        self.measured.setSuffix(" mm")
        row.add_together(label(self.tr("Measured length")), self.measured)
        correct = button(self.tr("Correct"))
        correct.clicked.connect(self._correct)
        self.rotate = button(
            self.tr("Rotate 90°"), tip=self.tr("Exchange width and height: the screen stands on its side")
        )
        self.rotate.clicked.connect(lambda: self._change(turned_panel(self._space.settings.panel)))
        row.addWidget(correct)
        row.addWidget(self.rotate)
        panel.body.addLayout(row)
        return panel

    # --- showing --------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Show the settings."""
        panel = self._space.settings.panel
        try:
            screen = panel.screen()
        except DraglagError as error:
            self.verdict.setText(in_words(error.message))
            return
        self.preset.setCurrentIndex(max(0, self.preset.findData(panel.preset)))
        middle = screen.height_mm / 2
        for key, value in (
            ("width_mm", screen.width_mm),
            ("height_mm", screen.height_mm),
            ("stylus_mm", panel.stylus_mm),
            ("beam_slope", panel.beam_slope),
            ("beam_intercept_mm", middle if panel.beam_intercept_mm is None else panel.beam_intercept_mm),
        ):
            self.fields[key].setValue(value)  # type: ignore[arg-type]
        self.fields["width_px"].setValue(screen.width_px)
        self.fields["height_px"].setValue(screen.height_px)
        simulated = self._space.settings.rig.simulated
        text = self.tr("The simulated rig brings its own screen, stylus and beam; only the preset counts.")
        self.simulated.setText(text if simulated else "")
        self._judge(screen)
        self._draw(screen)
        self.calibration.refresh()

    def _judge(self, screen: Screen) -> None:
        desktop = self._desktop_screen()
        said = desktop.physicalSize().width() if desktop is not None else 0.0
        wrong = shape_problem(screen, desktop) if desktop is not None and self._has_screen() else ""
        if wrong:
            self.verdict.setText(wrong)
            restyle(self.verdict, "level", "bad")
            return
        if not self._has_screen() or said <= 0:
            self.verdict.setText(self.tr("Nothing to compare with: the participant has no screen of their own."))
            restyle(self.verdict, "level", "")
            return
        apart = abs(screen.width_mm / said - 1)
        text = self.tr("The desktop reports a width of {said:.0f} mm, these settings {mm:.1f} mm.").format(
            said=said, mm=screen.width_mm
        )
        if apart > _DISAGREE:
            text += " " + self.tr("They disagree: use a ruler.")
        self.verdict.setText(text)
        restyle(self.verdict, "level", "warning" if apart > _DISAGREE else "ok")

    def _has_screen(self) -> bool:
        return self._space.settings.rig.display not in ("window", "offscreen")

    def _draw(self, screen: Screen) -> None:
        panel, colours = self._space.settings.panel, theme()
        self.plot.clear_all()
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) * [screen.width_mm, screen.height_mm]
        self.plot.line(tr("screen"), corners[:, 0], corners[:, 1], colours.text, 2)
        x = np.array([0.0, screen.width_mm])
        intercept = screen.height_mm / 2 if panel.beam_intercept_mm is None else panel.beam_intercept_mm
        self.plot.line(tr("beam"), x, panel.beam_slope * x + intercept, colours.bad, 2, dash=True)
        turn = np.linspace(0, 2 * np.pi, 60)
        centre = (screen.width_mm / 2, panel.beam_slope * screen.width_mm / 2 + intercept)
        for name, radius, colour in (
            (tr("stylus"), panel.stylus_mm / 2, colours.orange),
            (tr("target circle"), 0.1 * screen.width_mm, colours.blue),
        ):
            self.plot.line(name, centre[0] + radius * np.cos(turn), centre[1] + radius * np.sin(turn), colour, 2)
        self.plot.autoRange(padding=0.04)

    # --- changing -------------------------------------------------------------------------------------------

    def _preset_chosen(self) -> None:
        name = str(self.preset.currentData())
        stylus_mm = load_screen_file(name).stylus.diameter_mm
        self._change(PanelSettings(preset=name, stylus_mm=stylus_mm))

    def _numbers_edited(self) -> None:
        values = {key: field.value() for key, field in self.fields.items()}
        panel = self._space.settings.panel
        known = panel.screen()
        changes: dict[str, object] = {}
        for key in ("width_mm", "height_mm", "width_px", "height_px"):
            if abs(values[key] - getattr(known, key)) > 1e-6:
                changes[key] = values[key]
        middle = known.height_mm / 2
        present = middle if panel.beam_intercept_mm is None else panel.beam_intercept_mm
        if abs(values["beam_intercept_mm"] - present) > 0.051 or values["beam_slope"] != panel.beam_slope:
            changes |= {key: values[key] for key in ("beam_intercept_mm", "beam_slope")}
        if values["stylus_mm"] != panel.stylus_mm:
            changes["stylus_mm"] = values["stylus_mm"]
        if changes:
            self._change(panel.model_copy(update=changes))

    def _change(self, panel: PanelSettings) -> None:
        before = self._space.settings.panel
        if panel == before:
            return
        change = self._space.change_settings
        self._space.undo.push(Edit(self.tr("geometry"), lambda: change(panel=panel), lambda: change(panel=before)))

    def _calibrated(self, calibration: CalibrationSettings | None) -> None:
        panel = self._space.settings.panel
        self._change(panel.model_copy(update={"calibration": calibration}))

    def _correct(self) -> None:
        panel = self._space.settings.panel
        screen, factor = panel.screen(), self.measured.value() / BAR_MM
        sizes = {"width_mm": round(screen.width_mm * factor, 1), "height_mm": round(screen.height_mm * factor, 1)}
        self._change(panel.model_copy(update=sizes))
        self.measured.setValue(BAR_MM)

    # --- the ruler ------------------------------------------------------------------------------------------

    def _desktop_screen(self) -> QScreen | None:
        screens, chosen = QGuiApplication.screens(), self._space.settings.rig.display
        number = int(chosen.split()[-1]) if chosen.startswith("screen") else 1
        return screens[number - 1] if number <= len(screens) else None

    def _toggle_ruler(self) -> None:
        if self._ruler is not None:
            self._ruler.close()
            return
        screen = self._desktop_screen()
        if screen is None:
            return
        self._ruler = RulerWindow(self._space.settings.panel.screen(), screen)
        self._ruler.destroyed.connect(self._ruler_gone)

    def _ruler_gone(self) -> None:
        self._ruler = None

    def restyle_plots(self) -> None:
        """Draw in the present theme."""
        self.plot.restyle()
        self.calibration.picture.restyle()
        self.refresh()
