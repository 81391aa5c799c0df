"""An analysis in words and tables, as ``draglag analyze`` prints it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from draglag.analysis import Analysis
from draglag.instruments.clocks import rate_words
from draglag.latency.conduct import UNEVEN_TRACE
from draglag_app.cli.common import flags_block, number, table


def analysis_in_words(analysis: Analysis, result: dict[str, Any]) -> list[str]:
    """Blocks of text for people."""
    rate = analysis.options.update_rate_hz
    stamps = "the kernel's stamps" if rate is None else f"a loop at {rate:g} Hz holding the last event"
    mark = "SIMULATED · " if analysis.source is not None and analysis.source.simulated else ""
    blocks = [f"{mark}{analysis.session}: {analysis.options.estimator} estimator on {stamps}"]
    if result["runs"]:
        blocks += [_runs(result["runs"]), *_flags(result["runs"])]
    if analysis.curve is not None:
        blocks.append(_curve(result["curve"]))
    blocks += _listed("Taps, median", _taps(result["taps"]))
    blocks += _listed("Checks", _verification(result["verification"]))
    if result["validation"]:
        blocks += [_validation(result["validation"]), *_flags(result["validation"])]
    blocks += _excluded(analysis)
    blocks += _listed("Warnings", analysis.warnings)
    return blocks + _listed("Not done", analysis.problems)


def _excluded(analysis: Analysis) -> list[str]:
    """Runs that may be included, and those that may not: their speed is wrong."""
    again = {run: f"; repeated as {by}" for run, by in analysis.repeated.items()}
    lines = {run: f"{run}: {why}{again.get(run, '')}" for run, why in analysis.excluded.items()}
    uneven = {run.id for run in analysis.runs if UNEVEN_TRACE in run.flags}
    others = "Not in the curve (--include RUN includes a run)"
    wrong = "Not in the curve (the trace's speed is not the stylus' own: record again and turn far from the beam)"
    return [
        *_listed(others, (line for run, line in lines.items() if run not in uneven)),
        *_listed(wrong, (line for run, line in lines.items() if run in uneven)),
    ]


def _listed(title: str, lines: Iterable[str]) -> list[str]:
    text = "".join(f"\n  {line}" for line in lines)
    return [title + text] if text else []


def _flags(rows: list[dict[str, Any]]) -> list[str]:
    return flags_block(flag for row in rows for flag in row["flags"])


def _taps(taps: dict[str, Any]) -> list[str]:
    return [
        f"{name:<8}{number(tap['median_ms'], 2)} ms (quartiles {number(tap['iqr_ms'][0], 2)} to "
        f"{number(tap['iqr_ms'][1], 2)}), {tap['n']} taps"
        for name, tap in taps.items()
    ]


def _runs(runs: list[dict[str, Any]]) -> str:
    rows = []
    for run in sorted(runs, key=lambda run: run["speed_mm_s"] or 0.0):
        low_high = run["latency_ci95_ms"]
        interval = f"{number(low_high[0], 2)} to {number(low_high[1], 2)}" if low_high else "–"
        rows.append(
            [
                run["id"],
                number(run["speed_mm_s"]),
                number(run["latency_ms"], 2),
                interval,
                str(run["n_edges"]),
                number(run["J_per_edge_mm2"], 4),
                number(run["stylus_diameter_mm"], 2),
                ", ".join(run["flags"]) or "ok",
            ]
        )
    head = ["run", "speed mm/s", "latency ms", "95 % interval", "edges", "J/edge mm²", "stylus mm", "verdict"]
    return table(head, rows)


def _curve(curve: dict[str, Any]) -> str:
    parameters = ", ".join(f"{name} = {value:.4g}" for name, value in curve["parameters"].items())
    low, high = curve["speed_range_mm_s"]
    lines = [
        f"Curve ({curve['form'].replace('_', ' ')}), RMS {number(curve['rms_ms'], 2)} ms, {low:.0f} to {high:.0f} mm/s",
        f"  {parameters}",
    ]
    return "\n".join(lines)


def _verification(found: dict[str, Any]) -> list[str]:
    lines = []
    for check in found["asymptote"]:
        low, high = check["difference_ci95_ms"]
        verdict = "equivalent" if check["equivalent"] else "not shown to be equivalent"
        lines.append(
            f"{check['taps']} tap minus asymptote a7: {check['difference_ms']:.2f} ms ({low:.2f} to {high:.2f}), "
            f"{verdict} within ±{check['margin_ms']:g} ms"
        )
    if (width := found["stylus_width"]) is not None:
        low, high = width["mean_ci95_mm"]
        lines.append(f"stylus {width['mean_mm']:.2f} mm ({low:.2f} to {high:.2f}), known {width['known_mm']:g} mm")
    for drift in found["clocks"]:
        se_ms = 60e-3 * drift["drift_se_ppm"]
        lines.append(
            f"the {drift['stream']} clock runs {rate_words(drift['drift_ppm'], 2)} against the host's "
            f"(± {drift['drift_se_ppm']:.2f} ppm), {abs(drift['ms_per_minute']):.3f} ± {se_ms:.3f} ms a minute "
            "(standard error; the paper's limit: 1)"
        )
    return lines


def _validation(rows: list[dict[str, Any]]) -> str:
    head = ["validation", "target", "J(0)/N mm²", "J/N mm²", "ΔJ %", "verdict"]
    cells = [
        [
            row["run"],
            row["protocol"],
            number(row["J0_per_edge_mm2"], 2),
            number(row["J_per_edge_mm2"], 4),
            number(row["delta_J_percent"], 2),
            ", ".join(row["flags"]) or "ok",
        ]
        for row in rows
    ]
    return table(head, cells, left=2)
