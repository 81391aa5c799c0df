"""A latency model as a file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

import draglag
from draglag.curve import FORMS, CurveFit
from draglag.errors import DataError, cause
from draglag.messages import message
from draglag.provenance import Source
from draglag.reading import parse_json, read_text
from draglag.reading.limits import DOCUMENT_BYTES, RUNS
from draglag.reading.refusals import refusal
from draglag.recording import FloatArray
from draglag.shown import table_html
from draglag.simulation.effects import EFFECTS
from draglag.system.temporary import new_file

VERSION = 1
MADE_BY = message("Give a file made by analyze --save-model or gap --save-model")
LONGEST_S = 60.0  # no drag latency is near
OF_SPEED = "law of speed"  # what an effect is undone in
IN_THE_LAW = (OF_SPEED, "law")
Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Shape(_Table):
    """A displacement across the beam of a fitted shape: setting, amplitudes (mm), mean of the squares."""

    theta: tuple[Finite, ...] = ()
    sizes: tuple[Finite, ...] = ()
    about: Finite = 0.0


class ModelEffect(_Table):
    """One named cause that the gap workflow added; see ``draglag.simulation.effects``.

    ci95: 95 % intervals of the parameters. where: where it acts, in words.
    """

    id: Annotated[str, Field(min_length=1, max_length=100)]
    parameters: dict[str, Finite] = {}
    ci95: dict[str, tuple[Finite, Finite]] = {}
    where: str = ""
    indistinguishable_from: tuple[str, ...] = ()
    shape: Shape | None = None


class Provenance(_Table):
    """Where a model comes from."""

    session: str = ""
    screen: str = ""
    estimator: str = ""
    stamps: str = "kernel"
    runs: tuple[str, ...] = ()
    input_sha256: str = ""
    created_utc: str = ""
    software: str = ""
    screen_width_mm: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    screen_height_mm: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    gap_mm: tuple[Finite, Finite] | None = None
    noise_floor_mm: Finite | None = None
    verdict: str = ""
    simulated: bool = False


class LatencyModel(_Table):
    """L(v) with its uncertainty. Parameters in the units of their names; covariance in the order of ``parameters``."""

    format: Literal["draglag-model"] = "draglag-model"
    version: Literal[1] = 1
    form: str
    parameters: dict[str, Finite]
    covariance: tuple[tuple[Finite, ...], ...]
    speed_range_mm_s: tuple[Finite, Finite]
    n_points: Annotated[int, Field(ge=0, le=RUNS)]
    rms_ms: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    between_runs_ms: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    tied_asymptote_ms: Finite | None = None
    effects: tuple[ModelEffect, ...] = ()
    provenance: Provenance = Provenance()

    @model_validator(mode="after")
    def _consistent(self) -> LatencyModel:
        if self.form not in FORMS:
            raise ValueError(
                message("unknown curve form '{given}'; known: {known}", given=self.form, known=", ".join(FORMS))
            )
        names = FORMS[self.form].names
        if set(self.parameters) != set(names):
            raise ValueError(
                message("the form {given} has the parameters {names}", given=self.form, names=", ".join(names))
            )
        if len(self.covariance) != len(names) or any(len(row) != len(names) for row in self.covariance):
            raise ValueError(message("covariance must be {size} × {size}", size=len(names)))
        low, high = self.speed_range_mm_s
        if not 0 <= low <= high:
            raise ValueError(message("speed_range_mm_s must run from low to high"))
        with np.errstate(all="ignore"):
            law_s = self.curve.predict_s(np.append(0.0, np.linspace(low, high, 50)))
        if not (np.abs(law_s) < LONGEST_S).all():
            raise ValueError(message("the law gives latencies beyond {most:g} s; see its parameters", most=LONGEST_S))
        unknown = [effect.id for effect in self.effects if effect.id not in EFFECTS]
        if unknown:
            raise ValueError(
                message("unknown effect '{given}'; known: {known}", given=unknown[0], known=", ".join(EFFECTS))
            )
        return self

    @property
    def source(self) -> Source:
        """What the model was made from, dated by the model."""
        of = self.provenance
        return Source(of.session or "a model without a session", of.created_utc, of.simulated)

    @property
    def curve(self) -> CurveFit:
        """The curve, with its confidence band."""
        names = FORMS[self.form].names
        order = [list(self.parameters).index(name) for name in names]
        covariance = np.array(self.covariance, float)[np.ix_(order, order)]
        tied_s = None if self.tied_asymptote_ms is None else 1e-3 * self.tied_asymptote_ms
        return CurveFit(
            form=self.form,
            values=np.array([self.parameters[name] for name in names]),
            covariance=covariance,
            rms_s=1e-3 * self.rms_ms,
            speed_range_mm_s=self.speed_range_mm_s,
            between_runs_s=1e-3 * self.between_runs_ms,
            n_points=self.n_points,
            aicc=float("nan"),
            held_out_rms_s=float("nan"),
            tied_asymptote_s=tied_s,
        )

    def latency_s(self, speed_mm_s: FloatArray, extrapolate: bool = False) -> FloatArray:
        """L(v); outside the measured range the value at its end, unless ``extrapolate``.

        Of the effects only a low-speed plateau and a second filter belong to the law.
        """
        shown = np.asarray(speed_mm_s, float)
        speed, extra_s = shown, 0.0 * shown
        for effect in self.effects:
            home = EFFECTS[effect.id]
            speed = home.curve_speed(speed, effect.parameters)
            extra_s = extra_s + home.curve_extra_s(shown, effect.parameters)
        if not extrapolate:
            speed = np.clip(speed, *self.speed_range_mm_s)
        return np.asarray(self.curve.predict_s(speed) + extra_s)

    def __repr__(self) -> str:
        names = "".join(f", {effect.id}" for effect in self.effects)
        of = f" of {self.provenance.screen}" if self.provenance.screen else ""
        low, high = self.speed_range_mm_s
        return f"LatencyModel({self.form.replace('_', ' ')}{names}{of}, {low:.0f} to {high:.0f} mm/s)"

    def _repr_html_(self) -> str:
        rows = [
            (effect.id, name, value, *effect.ci95.get(name, (None, None)))
            for effect in self.effects
            for name, value in effect.parameters.items()
        ]
        effects = table_html("Effects", ["effect", "parameter", "value", "low", "high"], rows) if rows else ""
        return self.curve._repr_html_() + effects

    @property
    def not_compensated(self) -> tuple[str, ...]:
        """Ids of the effects that a law of speed cannot undo."""
        return tuple(effect.id for effect in self.effects if EFFECTS[effect.id].undone_in != OF_SPEED)


def model_of(
    curve: CurveFit,
    provenance: Provenance | None = None,
    effects: Sequence[tuple[str, Mapping[str, float]] | ModelEffect] = (),
) -> LatencyModel:
    """The model of a fitted curve. Raises DataError for anything else.

    >>> import draglag as dl
    >>> model = dl.model_of(dl.analyze(dl.read("session.h5")).curve)
    >>> bool(0.13 < model.latency_s(50.0) < 0.15)
    True
    """
    given: object = curve
    if not isinstance(given, CurveFit):
        raise DataError(
            message("expected a curve, found {found}", found=type(given).__name__),
            "Give that of an analysis, dl.analyze(session).curve; where it is None, its problems say why",
        )
    return LatencyModel(
        form=curve.form,
        parameters=dict(curve.parameters),
        covariance=tuple(tuple(float(v) for v in row) for row in curve.covariance),
        speed_range_mm_s=curve.speed_range_mm_s,
        n_points=curve.n_points,
        rms_ms=1e3 * curve.rms_s,
        between_runs_ms=1e3 * curve.between_runs_s,
        tied_asymptote_ms=None if curve.tied_asymptote_s is None else 1e3 * curve.tied_asymptote_s,
        effects=tuple(
            item if isinstance(item, ModelEffect) else ModelEffect(id=item[0], parameters=dict(item[1]))
            for item in effects
        ),
        provenance=provenance or Provenance(software=f"draglag {draglag.__version__}"),
    )


def save_model(model: LatencyModel, path: Path | str) -> None:
    """Write a model as JSON. Raises DataError if the file exists or cannot be written, and for what is no model.

    >>> import draglag as dl
    >>> dl.save_model(dl.model_of(dl.analyze(dl.read("session.h5")).curve), "saved.json")
    """
    path, given = Path(path), model
    if not isinstance(given, LatencyModel):
        raise DataError(
            message("expected a model, found {found}", found=type(given).__name__),
            "Make it first: dl.model_of(dl.analyze(session).curve)",
        )
    try:
        with new_file(path) as growing:
            text = json.dumps(model.model_dump(mode="json"), indent=2, ensure_ascii=False) + "\n"
            growing.write_text(text, "utf-8")
    except OSError as error:
        raise DataError(
            message("{path}: cannot be written ({why})", path=path, why=cause(error)), "Check the folder and free space"
        ) from error


def load_model(path: Path | str) -> LatencyModel:
    """A model from its file. Raises DataError.

    >>> import draglag as dl
    >>> dl.load_model("model.json").form
    'double_exponential'
    """
    path = Path(path)
    raw: Any = parse_json(read_text(path, DOCUMENT_BYTES, MADE_BY), path, MADE_BY)
    if isinstance(raw, dict) and raw.get("format") == "draglag-model" and raw.get("version", VERSION) != VERSION:
        known = message(
            "model version {version} is not known here, only {known}", version=repr(raw.get("version")), known=VERSION
        )
        raise DataError(message("{path}: {known}", path=path, known=known), "Save the model again, or update draglag")
    missing = next((effect for effect in _named_in(raw) if effect not in EFFECTS), None)
    if missing is not None:
        raise DataError(
            message("{path}: the effect {effect} is not known here", path=path, effect=missing),
            "Install the package that adds it, or update draglag",
        )
    try:
        model = LatencyModel.model_validate(raw)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        wrong = refusal(first, json=True)
        if place:
            wrong = message("{key}: {what}", key=place, what=wrong)
        raise DataError(message("{path}: not a latency model: {wrong}", path=path, wrong=wrong), MADE_BY) from None
    fault = _wrong_effect(model)
    if fault:
        raise DataError(message("{path}: not a latency model: {wrong}", path=path, wrong=fault), MADE_BY)
    return model


def _named_in(raw: Any) -> list[str]:
    """Ids of the effects in a file that may be no model."""
    if not isinstance(raw, dict) or raw.get("format") != "draglag-model" or not isinstance(raw.get("effects"), list):
        return []
    return [item["id"] for item in raw["effects"] if isinstance(item, dict) and isinstance(item.get("id"), str)]


def _wrong_effect(model: LatencyModel) -> str:
    ids = [effect.id for effect in model.effects]
    for effect in model.effects:
        if ids.count(effect.id) > 1:
            return message("the effect {effect} is named twice", effect=effect.id)
        if not effect.parameters and effect.shape is None and EFFECTS[effect.id].parameters:
            return message("the effect {effect} has no size", effect=effect.id)
        for spec in EFFECTS[effect.id].parameters:
            value, extent = effect.parameters.get(spec.name, spec.typical), spec.upper - spec.lower
            if not spec.lower - extent <= value <= spec.upper + extent:
                bounds = message("{low:g} to {high:g} {unit}", low=spec.lower, high=spec.upper, unit=spec.unit)
                return message(
                    "the effect {effect} has {parameter} {value:g}; the library knows {bounds}",
                    effect=effect.id,
                    parameter=spec.name,
                    value=value,
                    bounds=bounds,
                )
    return ""


def other_screen(model: LatencyModel, screen: str) -> str:
    """In words, that a model was fitted on another screen; or empty."""
    of = model.provenance.screen
    return (
        message("the model was fitted on {of}, this is {screen}", of=of, screen=screen)
        if of and screen and of != screen
        else ""
    )


def left_unexplained(model: LatencyModel) -> str:
    """In words, that the model's session holds an unnamed gap; or empty."""
    if model.provenance.verdict != "unexplained":
        return ""
    gap = "" if model.provenance.gap_mm is None else message(" of {gap_mm:.3f} mm", gap_mm=model.provenance.gap_mm[1])
    own = message("its own session ({session})", session=model.provenance.session)
    return message("the model leaves a gap{gap} in {own} that none of its effects explains", gap=gap, own=own)


def lookup_table(model: LatencyModel, n: int = 200) -> dict[str, FloatArray]:
    """The model over its measured range, with its 95 % band."""
    low, high = model.speed_range_mm_s
    speed = np.unique(np.geomspace(max(low, 1e-3), max(high, 2e-3), n))
    band = model.curve.band_s(speed)
    return {"speed_mm_s": speed, "latency_s": model.latency_s(speed), "low_s": band[0], "high_s": band[1]}


def save_lookup(model: LatencyModel, path: Path | str) -> None:
    """Write the table as .csv, or as .mat for MATLAB and Simulink's 1-D lookup block. Raises DataError."""
    path = Path(path)
    if path.suffix not in (".csv", ".mat"):
        raise DataError(message("{path}: the ending says neither CSV nor MATLAB", path=path), "Name it .csv or .mat")
    columns = lookup_table(model)
    try:
        if path.suffix == ".csv":
            rows = np.column_stack(list(columns.values()))
            with new_file(path) as growing:
                np.savetxt(growing, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
        else:
            from scipy.io import savemat

            content = {**columns, "form": model.form, "parameters": dict(model.parameters)}
            with new_file(path) as growing, growing.open("wb") as file:
                savemat(file, content, oned_as="column")
    except OSError as error:
        raise DataError(
            message("{path}: cannot be written ({why})", path=path, why=cause(error)), "Check the folder and free space"
        ) from error
