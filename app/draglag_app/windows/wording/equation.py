"""The fitted curve as an equation with its coefficients, typeset: digits as far as they are known, with units."""

from __future__ import annotations

import math
from html import escape

from draglag.curve import CurveFit

# Form → L(v), with subscripts and exponents as HTML has them.
EQUATIONS = {
    "constant": "L = a<sub>7</sub>",
    "single_exponential": "L(v) = a<sub>1</sub> e<sup>−a<sub>2</sub> v</sup> + a<sub>7</sub>",
    "double_exponential": (
        "L(v) = a<sub>1</sub> e<sup>−a<sub>2</sub> v</sup> + a<sub>4</sub> e<sup>−a<sub>5</sub> v</sup> + a<sub>7</sub>"
    ),
    "double_exponential_plateau": (
        "L(v) = a<sub>1</sub> e<sup>−a<sub>2</sub> u</sup> + a<sub>4</sub> e<sup>−a<sub>5</sub> u</sup> + a<sub>7</sub>"
        ", u = max(v, v<sub>0</sub>)"
    ),
    "adaptive_low_pass": "L(v) = L<sub>0</sub> + b / 2π(v<sub>c</sub> + v)",
}
# Parameter of a form → symbol and unit.
SYMBOLS = {
    "a1_ms": ("a<sub>1</sub>", "ms"), "a2_s_per_mm": ("a<sub>2</sub>", "s/mm"), "a4_ms": ("a<sub>4</sub>", "ms"),
    "a5_s_per_mm": ("a<sub>5</sub>", "s/mm"), "a7_ms": ("a<sub>7</sub>", "ms"),
    "plateau_mm_s": ("v<sub>0</sub>", "mm/s"), "corner_speed_mm_s": ("v<sub>c</sub>", "mm/s"),
    "inverse_beta_mm": ("b", "mm"), "l0_ms": ("L<sub>0</sub>", "ms"),
}  # fmt: skip


def matched(value: float, error: float) -> str:
    """Value ± standard error: the error with two digits, the value to the same place."""
    if not (math.isfinite(value) and math.isfinite(error)) or error <= 0.0:
        return f"{value:.4g}"
    place = 1 - math.floor(math.log10(error))
    rounded = round(error, place)
    if rounded >= 10 ** (2 - place):  # 0.0996 is 0.10, not 0.100
        place -= 1
    places = max(0, place)
    return f"{round(value, place):.{places}f} ± {round(error, place):.{places}f}"


def equation_html(curve: CurveFit) -> str:
    """The curve's form and its coefficients with standard errors; a form of another package has no equation."""
    errors = curve.standard_errors
    parts = []
    for name, value in curve.parameters.items():
        symbol, unit = SYMBOLS.get(name, (escape(name), ""))
        parts.append(f"{symbol} = {matched(value, errors[name])}&nbsp;{unit}".replace(" ± ", "&nbsp;±&nbsp;"))
    return " &nbsp; ".join(part for part in (EQUATIONS.get(curve.form, ""), ", ".join(parts)) if part)
