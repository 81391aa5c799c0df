"""The curve of an analysis as a model's file."""

from __future__ import annotations

from pathlib import Path

from draglag.analysis import Analysis
from draglag.errors import DataError
from draglag.messages import message
from draglag.provenance import is_simulated
from draglag.recording import Session
from draglag_app.cli.common import checksum, now_utc


def save_curve(path: Path, source: Path, data: Session, analysis: Analysis) -> None:
    """Write the curve of an analysis. Raises DataError without one."""
    import draglag
    from draglag.model.file import Provenance, model_of, save_model

    if analysis.curve is None:
        raise DataError(message("{source}: there is no curve to save", source=source), "See the verdict on its runs")
    rate = analysis.options.update_rate_hz
    provenance = Provenance(
        session=data.name,
        simulated=is_simulated(data.devices),
        screen=data.screen.name,
        estimator=analysis.options.estimator,
        stamps="kernel" if rate is None else f"last event held at {rate:g} Hz",
        runs=tuple(run.id for run in analysis.runs if run.latency_s is not None),
        input_sha256=checksum(source),
        created_utc=now_utc(),
        software=f"draglag {draglag.__version__}",
        screen_width_mm=data.screen.width_mm,
        screen_height_mm=data.screen.height_mm,
    )
    save_model(model_of(analysis.curve, provenance), path)
