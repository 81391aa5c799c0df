"""Touch calibration on the Geometry page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from PySide6.QtWidgets import QWidget

from draglag.errors import DraglagError
from draglag.instruments.calibration import AffineFit, target_places
from draglag.recording import Screen
from draglag_app.calibrating import TARGETS, size_mismatch
from draglag_app.windows.participant.docked import DockedPicture
from draglag_app.windows.participant.window import ParticipantWindow
from draglag_app.windows.parts.ask_files import ask_save
from draglag_app.windows.parts.flow import Flow
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.parts.widgets import Panel, button, label, restyle
from draglag_app.windows.plots.plot import Plot, tr
from draglag_app.windows.settings import CalibrationSettings
from draglag_app.windows.wording.library_words import in_words
from draglag_app.windows.workspace import Workspace
from draglag_devices.calibration import save_calibration

# Arrows are drawn so much longer that the longest spans this share of the screen's width.
_LONGEST = 0.12
# Shorter ones are not drawn longer: they are none.
_SMALLEST_MM = 0.02


class CalibrationPanel(Panel):
    """``store`` puts a calibration in use, or none."""

    def __init__(
        self,
        workspace: Workspace,
        store: Callable[[CalibrationSettings | None], None],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(tr("Touch calibration"), parent)
        self._space = workspace
        self._store = store
        self._docked: DockedPicture | None = None
        self.verdict = label("", "verdict", wrap=True)
        self.body.addWidget(self.verdict)
        self.picture = Plot("", tr("x (mm)"), tr("y (mm)"), "calibration")
        self.picture.setAspectLocked(True)
        self.picture.getPlotItem().vb.invertY(True)
        self.body.addWidget(self.picture, 1)
        self.figures = label("", "hint", wrap=True)
        self.body.addWidget(self.figures)
        row = Flow()
        self.begin = button(self.tr("Calibrate  Ctrl+K"), "primary")
        self.back = button(self.tr("One target back"))
        self.cancel = button(self.tr("Cancel"))
        self.save = button(self.tr("Save…"), tip=self.tr("As a file, for recordings without this window too"))
        self.forget = button(self.tr("Forget"), tip=self.tr("Use the size of the screen again"))
        calibrating = workspace.calibrating
        self.begin.clicked.connect(self.start)
        self.back.clicked.connect(calibrating.back)
        self.cancel.clicked.connect(calibrating.cancel)
        self.save.clicked.connect(self._save)
        self.forget.clicked.connect(lambda: self._store(None))
        for made in (self.begin, self.back, self.cancel, self.save, self.forget):
            row.addWidget(made)
        self.body.addLayout(row)
        workspace.recording.began.connect(lambda order: self.refresh())
        workspace.recording.ended.connect(lambda path, problem: self.refresh())
        calibrating.changed.connect(self.refresh)
        calibrating.made.connect(self._store)
        calibrating.refused.connect(self._refused)

    def start(self) -> None:
        """Begin, or say why not."""
        try:
            self._space.calibrating.start(self._space.settings)
        except DraglagError as error:
            self._refused(error.message)

    def dock(self, picture: ParticipantWindow) -> None:
        """Show the participant's picture until the calibration ends."""
        self._docked = DockedPicture(picture)
        self.body.replaceWidget(self.picture, self._docked)
        self.picture.hide()
        picture.setFocus()  # Esc and Backspace, as in a window of its own

    def _undock(self) -> None:
        if self._docked is not None:
            self.body.replaceWidget(self._docked, self.picture)
            self._docked.hide()
            self._docked.deleteLater()
            self._docked = None
            self.picture.show()

    def refresh(self) -> None:
        """Show the progress, or the calibration in use."""
        calibrating, known = self._space.calibrating, self._space.settings.panel.calibration
        active = calibrating.active
        self.begin.setVisible(not active)
        self.begin.setEnabled(not self._space.recording.active)
        self.back.setVisible(active)
        self.back.setEnabled(bool(calibrating.touches.found))
        self.cancel.setVisible(active)
        for one in (self.save, self.forget):
            one.setVisible(known is not None and not active)
        self.picture.clear_all()
        self.figures.setText("")
        if active:
            n = len(calibrating.touches.found) + 1
            text = self.tr("Touch the cross on the participant's screen: {k} of {n}.").format(k=n, n=TARGETS)
            self._say(f"{text} {calibrating.fault}", "warning" if calibrating.fault else "")
            return
        self._undock()
        if known is None:
            self._say(self.tr("None: positions come from the size of the screen."), "")
            return
        try:
            screen = self._space.settings.touched_screen()
            self._show(known, known.fit(screen), screen)
        except DraglagError as error:
            self._say(in_words(error.message), "bad")

    def _show(self, known: CalibrationSettings, fit: AffineFit, screen: Screen) -> None:
        off_mm = np.hypot(*fit.residual_mm.T)
        text = self.tr("{device}: {n} targets, RMS {rms:.2f} mm, worst {worst:.2f} mm.").format(
            device=in_words(known.device or known.address), n=len(off_mm), rms=fit.rms_mm, worst=fit.worst_mm
        )
        level, doubt = "ok", size_mismatch(fit, known.resolution)
        if not known.serves(self._space.settings.rig.touch):
            level = "warning"
            text += " " + self.tr("Not in use: it was made on {address}.").format(address=known.address)
        elif doubt is not None:
            level = "warning"
            text += " " + self.tr(
                "The touchscreen's own resolution differs by {percent:.0f} %: check the size with a ruler."
            ).format(percent=100 * doubt)
        self._say(text, level)
        each = "   ".join(f"{k}:\u00a0{mm:.2f}" for k, mm in enumerate(off_mm, 1))
        self.figures.setText(self.tr("Residual at each target (mm): {each}").format(each=each))
        self._draw(fit, off_mm, screen)

    def _draw(self, fit: AffineFit, off_mm: np.ndarray, screen: Screen) -> None:
        colours, plot = theme(), self.picture
        x, y = target_places(screen.width_mm, screen.height_mm, TARGETS)
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) * [screen.width_mm, screen.height_mm]
        longer = _round(_LONGEST * screen.width_mm / max(float(off_mm.max()), _SMALLEST_MM))
        ends = np.column_stack([x, y]) + longer * fit.residual_mm
        gap = np.full(len(x), np.nan)
        plot.line(tr("screen"), corners[:, 0], corners[:, 1], colours.muted, 1)
        plot.line(
            tr("residuals × {n:g}").format(n=longer),
            np.column_stack([x, ends[:, 0], gap]).ravel(),
            np.column_stack([y, ends[:, 1], gap]).ravel(),
            colours.orange,
            3,
        )
        words = [
            tr("target {k}: {mm:.2f} mm off\n{x:+.2f} mm across, {y:+.2f} mm down").format(k=k, mm=mm, x=dx, y=dy)
            for k, (mm, (dx, dy)) in enumerate(zip(off_mm, fit.residual_mm, strict=True), 1)
        ]
        plot.dots(tr("targets"), x, y, colours.blue, "+", 12, words=words)
        plot.rename(tr("Residuals × {n:g}").format(n=longer))
        plot.autoRange(padding=0.04)

    def _save(self) -> None:
        known, screen = self._space.settings.panel.calibration, self._space.settings.touched_screen()
        start = Path(self._space.settings.folder) / "calibration.json"
        if known is None:
            return

        def write(path: Path) -> None:
            try:
                save_calibration(known.fit(screen), path, known.device, known.recorded(screen))
            except DraglagError as error:
                self._refused(error.message)
            else:
                self._space.noticed.emit("info", tr("Saved: {path}").format(path=path))

        ask_save(self, self.tr("Save calibration"), start, self.tr("Calibrations (*.json)"), write)

    def _refused(self, text: str) -> None:
        self.refresh()
        self._say(in_words(text), "bad")
        self._space.noticed.emit("error", text)

    def _say(self, text: str, level: str) -> None:
        self.verdict.setText(text.strip())
        restyle(self.verdict, "level", level)


def _round(value: float) -> float:
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value))
