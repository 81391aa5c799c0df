"""Deadbands, which keep a still finger's reports still: jump, backlash, and the fuzz filter of the Linux kernel."""

import math

import numpy as np

KINDS = ("jump", "backlash", "fuzz")


def deadband(xy: tuple[np.ndarray, np.ndarray], size_mm: float, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """x and y (n,) behind a deadband of one kind."""
    if kind == "jump":
        return jump(xy, size_mm)
    x, y = ((backlash if kind == "backlash" else fuzz)(q, size_mm) for q in xy)
    return x, y


def jump(xy: tuple[np.ndarray, np.ndarray], size_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Nothing until the touch is `size_mm` away from the last report, then all of it."""
    x, y = float(xy[0][0]), float(xy[1][0])
    out_x, out_y = [], []
    for px, py in zip(xy[0].tolist(), xy[1].tolist(), strict=True):
        if math.hypot(px - x, py - y) >= size_mm:
            x, y = px, py
        out_x.append(x)
        out_y.append(y)
    return np.array(out_x), np.array(out_y)


def backlash(q: np.ndarray, size_mm: float) -> np.ndarray:
    """A coordinate that is drawn along `size_mm` behind, as by a gear with play."""
    at, out = float(q[0]), []
    for p in q.tolist():
        at = min(max(at, p - size_mm), p + size_mm)
        out.append(at)
    return np.array(out)


def fuzz(q: np.ndarray, size_mm: float) -> np.ndarray:
    """A coordinate after the kernel's filter: held within half of `size_mm`, a quarter of the way within the whole,
    half of the way within twice that, free beyond (input_defuzz_abs_event, without its integers)."""
    at, out = float(q[0]), []
    for p in q.tolist():
        away = abs(p - at)
        if away >= 2 * size_mm:
            at = p
        elif away >= size_mm:
            at = (at + p) / 2
        elif away >= size_mm / 2:
            at = (3 * at + p) / 4
        out.append(at)
    return np.array(out)
