"""Results as tidy tables: rows, pandas, xarray."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from draglag.system.packages import need

if TYPE_CHECKING:
    from draglag.analysis.session import Analysis

# Columns of a run with what they are; the unit ends the name.
RUN_COLUMNS = {
    "run": "id of the run",
    "protocol": "its target",
    "nominal_speed_mm_s": "speed of the target",
    "speed_mm_s": "speed of the stylus",
    "latency_ms": "latency at that speed",
    "latency_low_ms": "lower end of its 95 % interval",
    "latency_high_ms": "upper end of its 95 % interval",
    "n_edges": "edges it is made of",
    "J_per_edge_mm2": "mean squared misalignment that is left",
    "stylus_diameter_mm": "width of the stylus by Eq. 3",
    "in_curve": "whether it is a point of the curve",
    "flags": "its verdict; empty where all is well",
}
CURVE_POINTS = 100  # of the curve in arrays: as smooth as a screen shows


def run_rows(analysis: Analysis) -> list[dict[str, Any]]:
    """One row of ``RUN_COLUMNS`` a run of constant speed."""
    rows = []
    for run in analysis.runs:
        low, high = run.latency_ci95_ms or (None, None)
        values = (
            run.id, run.protocol, run.nominal_speed_mm_s, run.speed_mm_s, run.latency_ms, low, high, run.n_edges,
            run.j_per_edge_mm2, run.stylus_diameter_mm, analysis.in_curve(run), " ".join(run.flags),
        )  # fmt: skip
        rows.append(dict(zip(RUN_COLUMNS, values, strict=True)))
    return rows


def frame_of(rows: list[dict[str, Any]], columns: list[str]) -> Any:
    """The rows as a pandas DataFrame. Raises DraglagError without pandas."""
    need("pandas")
    import pandas

    frame = pandas.DataFrame(rows, columns=columns)
    for name in frame.columns:
        if frame[name].dtype == object and name.endswith(("_mm_s", "_ms", "_mm2", "_mm")):
            frame[name] = pandas.to_numeric(frame[name])
    return frame


def dataset_of(analysis: Analysis) -> Any:
    """As ``Analysis.to_xarray``."""
    need("xarray")
    import xarray

    rows = run_rows(analysis)
    variables: dict[str, Any] = {}
    for name, words in RUN_COLUMNS.items():
        values = [row[name] for row in rows]
        if name in ("run", "protocol", "flags"):
            array = np.array(values, dtype=str)
        else:
            array = np.array([np.nan if value is None else value for value in values])
        key = "mean_speed_mm_s" if name == "speed_mm_s" else name
        variables[key] = ("run", array, {"long_name": words, **_unit(name)})
    curve = analysis.curve
    if curve is not None:
        speed = np.geomspace(max(curve.speed_range_mm_s[0], 1.0), curve.speed_range_mm_s[1], CURVE_POINTS)
        low, high = curve.band_s(speed)
        variables["speed_mm_s"] = ("speed_mm_s", speed, {"units": "mm/s"})
        for name, values_s in (("curve_ms", curve.predict_s(speed)), ("curve_low_ms", low), ("curve_high_ms", high)):
            variables[name] = ("speed_mm_s", 1e3 * values_s, {"units": "ms"})
    about = {"session": analysis.session, "estimator": analysis.options.estimator}
    about["form"] = "" if curve is None else curve.form
    coordinates = {name: variables.pop(name) for name in ("run", "speed_mm_s") if name in variables}
    return xarray.Dataset(variables, coordinates, about)


def _unit(name: str) -> dict[str, str]:
    for end, unit in (("_mm_s", "mm/s"), ("_ms", "ms"), ("_mm2", "mm^2"), ("_mm", "mm")):
        if name.endswith(end):
            return {"units": unit}
    return {}
