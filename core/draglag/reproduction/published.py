"""The paper's numbers."""

from __future__ import annotations

TABLE_2: dict[str, dict[str, float]] = {
    "Screen 1": {
        "a1_ms": 90.53, "a2_s_per_mm": 4.00e-3, "a4_ms": 182.9, "a5_s_per_mm": 2.90e-2, "a7_ms": 28.49, "rms_ms": 1.43,
    },
    "Screen 2": {
        "a1_ms": 9.90, "a2_s_per_mm": 7.92e-2, "a4_ms": 313.7, "a5_s_per_mm": 1.88e-2, "a7_ms": 23.65, "rms_ms": 2.19,
    },
    "Screen 2 (corrected)": {
        "a1_ms": 9.57, "a2_s_per_mm": 3.30e-3, "a4_ms": 440.7, "a5_s_per_mm": 1.98e-2, "a7_ms": 28.22, "rms_ms": 2.24,
    },
}  # fmt: skip

# Screen → target → (J(0)/N mm², ΔJ %)
TABLE_3: dict[str, dict[str, tuple[float, float]]] = {
    "Screen 1": {"chirp": (206.71, 99.51), "multisine": (71.09, 88.02), "step": (334.07, 96.73)},
    "Screen 2": {"chirp": (82.94, 99.36), "multisine": (34.34, 96.39), "step": (314.55, 95.42)},
}

RELEASE_TAP_MS = {"Screen 1": 28.75, "Screen 2": 28.14}
PRESETS = {"Screen 1": "screen-1", "Screen 2": "screen-2-uncorrected", "Screen 2 (corrected)": "screen-2"}
PLATEAU_MM_S = 100.0  # of Screen 2. Section III.A: a plateau "for input speeds below 100 mm/s"
