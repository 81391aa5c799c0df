"""``draglag demo``."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path

import click

from draglag.analysis import Analysis, AnalysisOptions, analyze
from draglag.errors import DataError, DraglagError, cause
from draglag.messages import message
from draglag.protocol.runs import load_protocol
from draglag.recording import Session
from draglag.store import add_analysis, read_with_state
from draglag.system.packages import need
from draglag_app.cli.common import Seed
from draglag_app.cli.record import record_with, session_options
from draglag_app.cli.window import open_window
from draglag_devices.rig import make_rig


@click.command("demo")
@click.option("--out", type=click.Path(path_type=Path), default=Path("draglag-demo"), show_default=True,
              help="Folder for session.h5, report.html and the figures.")  # fmt: skip
@click.option("--screen", "screen_name", default="screen-1", show_default=True, help="Which screen to simulate.")
@click.option("--seed", type=Seed(), help="Of the simulation and the order of runs.")
@click.option("--window/--no-window", default=True, help="Open the operator window on the result.")
def demo(out: Path, screen_name: str, seed: int | None, window: bool) -> None:
    """Measure a simulated touchscreen from the moving target to the curve of latency against speed.

    \b
    Example:
        draglag demo --out my-demo --screen screen-2
    """
    from draglag.report import write_report

    need("matplotlib")
    path = out / "session.h5"
    if path.exists():
        raise DataError(
            message("{path}: exists already and is not overwritten", path=path), "Choose another folder with --out"
        )
    protocol = load_protocol("demo")
    rig = make_rig(
        dict.fromkeys(("touch", "laser", "walt"), "sim:"),
        screen_name,
        protocol.seed if seed is None else seed,
        fast=True,
    )
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(
            message("{path}: cannot be made ({why})", path=out, why=cause(error)), "Choose a folder you may write"
        ) from None
    record_with(protocol, rig, None, path, session_options(rig, screen_name, seed))
    session, state = read_with_state(path)
    options = AnalysisOptions()
    analysis = analyze(session, options)
    made = datetime.now(UTC).isoformat(timespec="seconds")
    add_analysis(path, analysis.to_dict(), options.kept(), made, state)
    report = write_report(session, analysis, out)
    click.echo("\n".join(summary(session, analysis)))
    click.echo("\n" + "\n".join(f"{what:<9}{where}" for what, where in [("session", path), ("report", report)]))
    if window:
        _show(path, report)


def summary(session: Session, analysis: Analysis) -> list[str]:
    """Lines of results."""
    lines = [f"SIMULATED · {session.name}: {len(session.runs)} runs", "", "speed mm/s   latency ms   95 % interval"]
    for run in sorted(analysis.runs, key=lambda run: run.speed_mm_s or 0.0):
        numbers = run.to_dict()
        low_high = numbers.get("latency_ci95_ms")
        if run.latency_s is None:
            lines.append(f"{run.speed_mm_s or float('nan'):10.1f}   none: {', '.join(run.flags)}")
        else:
            interval = f"{low_high[0]:.1f} … {low_high[1]:.1f}" if isinstance(low_high, list | tuple) else ""
            lines.append(f"{run.speed_mm_s:10.1f}   {1e3 * run.latency_s:10.1f}   {interval}")
    if analysis.curve is not None:
        curve = analysis.curve.to_dict()
        lines += ["", f"curve    {curve['form']}, RMS {float(str(curve['rms_ms'])):.2f} ms"]
    for name, taps in analysis.taps.items():
        lines.append(f"taps     {name}: median {1e3 * taps.median_s:.1f} ms of {taps.n}")
    for item in analysis.validation:
        checked = item.to_dict()
        lines.append(f"check    {checked['protocol']}: ΔJ {float(str(checked['delta_J_percent'])):.1f} %")
    return lines + [f"note     {problem}" for problem in analysis.problems]


def _show(session: Path, report: Path) -> None:
    try:
        if os.environ.get("QT_QPA_PLATFORM", "").startswith(("offscreen", "minimal")):
            raise DraglagError("Qt is set to draw where nobody looks")  # and nobody would close it
        open_window(session)
    except DraglagError as error:
        click.echo(f"The operator window is left out: {error.problem} The report is {report}.", err=True)
