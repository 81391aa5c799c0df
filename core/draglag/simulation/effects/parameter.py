"""A number of an effect, with its bounds and its words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

# Unit in code → unit people read, and how many of it make one of the former.
_READ_AS = {
    "s": ("ms", 1e3), "s/h": ("ms/h", 1e3), "s per mm/s²": ("ms/(m/s²)", 1e6), "1": ("", 1.0), "1/min": ("/min", 1.0)
}  # fmt: skip
_ENDINGS = {"_mm_s2": "mm/s²", "_mm_s": "mm/s", "_s": "s", "_mm": "mm", "_hz": "Hz", "_ppm": "ppm"}
_DIGITS = 4
PER_CENT = ("%", 100.0)
"""How people read a share."""


@dataclass(frozen=True)
class Parameter:
    """A number of an effect.

    unit: in code; sound: largest absolute size on sound rigs; title: its name for people, by default ``name`` without
    its unit; read_as: unit that people read and how many of it make one ``unit``, by default ms for s.
    """

    name: str
    unit: str
    lower: float
    upper: float
    typical: float
    whole: bool = False
    sound: float = 0.0
    title: str = ""
    read_as: tuple[str, float] | None = None

    @property
    def in_words(self) -> str:
        """As "time constant"."""
        return self.title or plain_name(self.name)

    @property
    def shown_in(self) -> tuple[str, float]:
        """Unit that people read, and how many of it make one ``unit``."""
        return self.read_as or _READ_AS.get(self.unit, (self.unit, 1.0))


def plain_name(name: str) -> str:
    """The name without the unit at its end: "across" for ``across_s``."""
    ending = next((ending for ending in _ENDINGS if name.endswith(ending)), "")
    return name.removesuffix(ending).replace("_", " ")


def unit_of_name(name: str) -> str:
    """Unit that a name ends with; "1" without."""
    return next((unit for ending, unit in _ENDINGS.items() if name.endswith(ending)), "1")


def parameter_of(specs: tuple[Parameter, ...], name: str) -> Parameter:
    """The parameter of that name; one that a fit added has its unit from its name."""
    known = next((spec for spec in specs if spec.name == name), None)
    return known or Parameter(name, unit_of_name(name), float("-inf"), float("inf"), 0.0)


def amount(spec: Parameter, value: float, digits: int = _DIGITS) -> str:
    """Value with the unit that people read, as "24.9 ppm" or "12 %"."""
    unit, factor = spec.shown_in
    between = " " if unit and not unit.startswith("/") else ""
    return f"{_number(factor * value, digits)}{between}{unit}"


def ends(spec: Parameter, interval: tuple[float, float], digits: int = _DIGITS) -> tuple[str, str]:
    """Both ends of an interval in the unit that people read, without it."""
    _, factor = spec.shown_in
    return _number(factor * interval[0], digits), _number(factor * interval[1], digits)


def sizes_in_words(
    specs: tuple[Parameter, ...], sizes: Mapping[str, float], ci95: Mapping[str, tuple[float, float]]
) -> list[str]:
    """One text a number, as "extra 12 ms (11.5 to 12.5)"."""
    out = []
    for name, value in sizes.items():
        spec = parameter_of(specs, name)
        text = f"{spec.in_words} {amount(spec, value)}"
        if name in ci95:
            low, high = ends(spec, ci95[name])
            text += f" ({low} to {high})"
        out.append(text)
    return out


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}".replace("-", "−")
