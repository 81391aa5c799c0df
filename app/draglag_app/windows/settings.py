"""The operator's settings in TOML; errors never prevent starting."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tomli_w
from platformdirs import user_config_path, user_documents_path
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from draglag.errors import DataError, DraglagError, cause
from draglag.instruments.calibration import AffineFit
from draglag.messages import message
from draglag.protocol.presets import load_screen_file
from draglag.protocol.runs import load_protocol
from draglag.reading import parse_toml, read_bytes, read_text
from draglag.reading.limits import DOCUMENT_BYTES, SIZE_PX
from draglag.recording import Beam, Screen, Stylus, TouchCalibration
from draglag.simulation import rig_for_screen
from draglag_app.calibrating import TARGETS, as_recorded, fit_touches
from draglag_app.session.details import TEMPLATE
from draglag_devices.addresses import ROLES, parse_address

Positive = Annotated[float, Field(gt=0, lt=1e5, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class RigSettings(_Table):
    """Addresses of devices; an empty one is not used."""

    touch: str = ""
    laser: str = ""
    walt: str = ""
    fast: bool = False  # simulated and replayed sources as fast as the computer allows
    display: Annotated[str, Field(pattern=r"^(window|offscreen|screen [1-9]\d{0,2})$")] = "window"

    def addresses(self) -> dict[str, str]:
        """Role → address in use."""
        return {role: getattr(self, role) for role in ROLES if getattr(self, role)}

    @property
    def simulated(self) -> bool:
        """Whether all in use is simulated or replayed."""
        used = self.addresses().values()
        return bool(used) and all(address.startswith(("sim:", "replay:", "csv:")) for address in used)


class CalibrationSettings(_Table):
    """Nine touches in device units; targets' places follow from the panel's size."""

    address: str  # of the touchscreen, without options
    device: str = ""
    made_utc: str = ""
    x_raw: Annotated[tuple[Finite, ...], Field(min_length=TARGETS, max_length=TARGETS)]
    y_raw: Annotated[tuple[Finite, ...], Field(min_length=TARGETS, max_length=TARGETS)]
    resolution: tuple[int, ...] = ()  # of its axes, units per mm

    def serves(self, address: str) -> bool:
        """Whether it was made at that address, and this names no calibration file."""
        where, _, options = address.partition("?")
        return where == self.address and "calibration=" not in options

    def fit(self, screen: Screen) -> AffineFit:
        """The mapping to mm. Raises EstimateError."""
        return fit_touches(np.array(self.x_raw), np.array(self.y_raw), screen)

    def recorded(self, screen: Screen) -> TouchCalibration:
        """The calibration for a session file. Raises EstimateError."""
        x_raw, y_raw = np.array(self.x_raw), np.array(self.y_raw)
        return as_recorded(self.fit(screen), x_raw, y_raw, screen, self.device, self.made_utc)


class PanelSettings(_Table):
    """The screen under test; missing sizes are the preset's."""

    preset: str = "screen-1"
    width_mm: Positive | None = None
    height_mm: Positive | None = None
    width_px: Annotated[int, Field(gt=0, le=SIZE_PX)] | None = None
    height_px: Annotated[int, Field(gt=0, le=SIZE_PX)] | None = None
    stylus_mm: Positive = 7.0
    beam_slope: Finite = 0.0
    beam_intercept_mm: Finite | None = None
    calibration: CalibrationSettings | None = None

    def screen(self) -> Screen:
        """The panel. Raises DataError."""
        preset = load_screen_file(self.preset)
        known = preset.screen
        return Screen(
            preset.name,
            self.width_mm or known.width_mm,
            self.height_mm or known.height_mm,
            self.width_px or known.width_px,
            self.height_px or known.height_px,
        )

    def stylus(self) -> Stylus:
        return Stylus(self.stylus_mm)

    def beam(self) -> Beam | None:
        """The beam; None: the middle of the screen."""
        return None if self.beam_intercept_mm is None else Beam(self.beam_slope, self.beam_intercept_mm)


class Settings(_Table):
    """All settings; ``first_start``: until the operator has chosen a rig."""

    first_start: bool = True
    theme: Literal["dark", "light", "system"] = "dark"
    language: Literal["system", "en", "nl"] = "system"
    text_scale: Annotated[float, Field(ge=0.8, le=2.0)] = 1.0
    operator: str = ""
    participant: str = ""
    session_label: str = ""
    fields: dict[str, str] = Field(default_factory=dict)  # free fields of a session
    ask_details: bool = False  # before every session
    file_template: Annotated[str, Field(min_length=1)] = TEMPLATE
    folder: Annotated[str, Field(min_length=1)] = Field(default_factory=lambda: str(user_documents_path() / "draglag"))
    recent: tuple[str, ...] = ()  # session files, the last one first
    reopen: bool = False  # the last one, when the window opens
    geometry: str = ""  # of the window, as Qt keeps it, base64
    page: str = ""  # the one in sight when the window was closed
    protocol: str = "latency-sweep"
    begin_by_hand: bool = False
    sound: bool = False  # at the end of every run
    flash: bool = False
    reduced_motion: bool = False
    keys: dict[str, str] = Field(default_factory=dict)  # action → keys other than the usual ones
    rig: RigSettings = RigSettings()
    panel: PanelSettings = PanelSettings()

    def details(self) -> dict[str, str]:
        """Session details that have a text."""
        known = {"participant": self.participant, "session": self.session_label, "operator": self.operator}
        return {name: text for name, text in (known | self.fields).items() if text}

    def touched_screen(self) -> Screen:
        """The panel, or the simulated rig's. Raises DraglagError."""
        address = self.rig.touch
        if address.startswith("sim:"):
            return rig_for_screen(parse_address(address).options.get("screen", self.panel.preset)).screen
        return self.panel.screen()


def settings_path() -> Path:
    """The settings file: ``DRAGLAG_SETTINGS``, or in the user's config folder."""
    given = os.environ.get("DRAGLAG_SETTINGS")
    return Path(given) if given else user_config_path("draglag") / "settings.toml"


def load_settings(path: Path) -> tuple[Settings, str]:
    """Settings, and a sentence on what is wrong, else empty. Never raises.

    Defaults replace invalid values; an invalid file is copied, as the next change overwrites it.
    """
    if not os.path.exists(path):
        return Settings(), ""
    try:
        known = parse_toml(read_text(path, DOCUMENT_BYTES), path)
    except DataError as error:
        return Settings(), message(
            "{problem} The settings start from the defaults.{kept}", problem=error.problem, kept=_kept(path)
        )
    try:
        settings, problem = Settings.model_validate(known), ""
    except ValidationError as error:
        wrong = sorted({".".join(str(part) for part in fault["loc"]) for fault in error.errors()})
        problem = message(
            "{path}: {names} cannot be used and starts from the default.{kept}",
            path=path,
            names=", ".join(wrong),
            kept=_kept(path),
        )
        try:
            settings = Settings.model_validate(_without(known, [fault["loc"] for fault in error.errors()]))
        except ValidationError:
            settings = Settings()
    try:
        settings.panel.screen()
    except DraglagError as error:
        return settings.model_copy(update={"panel": PanelSettings()}), error.message
    try:
        load_protocol(settings.protocol)
    except DraglagError as error:
        return settings, problem or error.message
    return settings, problem


def _without(known: dict[str, Any], places: Iterable[tuple[int | str, ...]]) -> dict[str, Any]:
    out = {key: dict(value) if isinstance(value, dict) else value for key, value in known.items()}
    for first, *rest in places:
        inner = out.get(str(first))
        if rest and isinstance(inner, dict):
            inner.pop(str(rest[0]), None)
        else:
            out.pop(str(first), None)
    return out


def _kept(path: Path) -> str:
    copy = path.with_name(path.name + ".unusable")
    try:
        copy.write_bytes(read_bytes(path, DOCUMENT_BYTES))
    except (DataError, OSError):
        return ""
    return message(" As it was it is kept in {name}.", name=copy.name)


def save_settings(settings: Settings, path: Path) -> None:
    """Write in one step. Raises DataError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(path.name + ".new")
        temporary.write_text(tomli_w.dumps(settings.model_dump(exclude_none=True)), "utf-8")
        temporary.replace(path)
    except OSError as error:
        raise DataError(
            message("{path}: the settings cannot be saved ({why})", path=path, why=cause(error)), "Check the folder"
        ) from None
