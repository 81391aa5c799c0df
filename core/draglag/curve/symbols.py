"""Symbols and units of a form's parameters."""

from __future__ import annotations

SYMBOLS = {
    "a1_ms": ("a1", "ms"), "a2_s_per_mm": ("a2", "s/mm"), "a4_ms": ("a4", "ms"), "a5_s_per_mm": ("a5", "s/mm"),
    "a7_ms": ("a7", "ms"), "plateau_mm_s": ("v0", "mm/s"), "corner_speed_mm_s": ("vc", "mm/s"),
    "inverse_beta_mm": ("b", "mm"), "l0_ms": ("L0", "ms"), "exponent": ("p", ""), "at_100_mm_s_ms": ("c", "ms"),
}  # fmt: skip
"""Parameter → symbol (a letter and its subscript) and unit."""


def symbol_html(parameter: str) -> tuple[str, str]:
    """Symbol, as HTML, and unit; for an unknown parameter its name."""
    if parameter not in SYMBOLS:
        return parameter, ""
    symbol, unit = SYMBOLS[parameter]
    return symbol[0] + (f"<sub>{symbol[1:]}</sub>" if symbol[1:] else ""), unit
