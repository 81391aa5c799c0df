"""The fitted curve as an equation."""

from __future__ import annotations

from html import escape

from draglag.curve import CurveFit
from draglag.curve.symbols import symbol_html
from draglag.shown import matched

# After it no line begins: "s/mm" stays in one.
_JOINER = "\u2060"
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
    "power": "L(v) = L<sub>0</sub> + c (v / 100&nbsp;mm/s)<sup>−p</sup>",
}


def equation_html(curve: CurveFit) -> str:
    """Equation, if known, and coefficients with half 95 % intervals."""
    half, parts = curve.half_intervals, []
    for name, value in sorted(curve.parameters.items()):
        symbol, unit = symbol_html(escape(name))
        unit = f"&nbsp;{unit}".replace("/", f"/{_JOINER}") if unit else ""
        parts.append(f"{symbol} = {matched(value, half[name])}{unit}".replace(" ± ", "&nbsp;±&nbsp;"))
    return " &nbsp; ".join(part for part in (EQUATIONS.get(curve.form, ""), ", ".join(parts)) if part)
