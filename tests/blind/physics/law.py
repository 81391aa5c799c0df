"""Laws of five forms: how late a report is at a speed."""

from dataclasses import dataclass

import numpy as np

FORMS = ("constant", "power", "adaptive", "logistic", "double")
VELOCITY = "velocity"
"""Of a profile: the form "double", of the size of a mean velocity and not of the speed."""
SLOWEST_MM_S = 15.0  # a power of the speed grows no further below this


@dataclass(frozen=True)
class Law:
    """Latency by speed. Parameters in s, mm/s, s/mm, Hz; which there are depends on the form."""

    form: str
    parameters: dict[str, float]

    def __call__(self, speed_mm_s: np.ndarray) -> np.ndarray:
        """Latency in seconds at each speed, in the shape of `speed_mm_s`."""
        p, v = self.parameters, speed_mm_s
        if self.form == "constant":
            return np.full_like(v, p["level"])
        if self.form == "power":
            return p["floor"] + p["scale"] * (np.maximum(v, SLOWEST_MM_S) / 45.0) ** -p["power"]
        if self.form == "adaptive":
            return p["floor"] + 1 / (2 * np.pi * (p["f0"] + p["beta"] * v))
        if self.form == "logistic":
            return p["floor"] + (p["slow"] - p["floor"]) / (1 + (v / p["middle"]) ** 3)
        return p["a1"] * np.exp(-p["a2"] * v) + p["a4"] * np.exp(-p["a5"] * v) + p["a7"]

    @property
    def asymptote_s(self) -> float:
        """What is left at any speed: the delay of a tap."""
        return self.parameters[{"constant": "level", "double": "a7"}.get(self.form, "floor")]


def draw_law(rng: np.random.Generator, form: str) -> Law:
    """A law of one of the five forms, with parameters as screens have them."""
    if form == "constant":
        return Law(form, {"level": rng.uniform(0.03, 0.09)})
    if form == "power":
        floor, scale, power = rng.uniform(0.02, 0.03), rng.uniform(0.08, 0.14), rng.uniform(0.5, 1.0)
        return Law(form, {"floor": floor, "scale": scale, "power": power})
    if form == "adaptive":
        floor, f0, beta = rng.uniform(0.02, 0.03), rng.uniform(0.6, 1.5), rng.uniform(0.01, 0.03)
        return Law(form, {"floor": floor, "f0": f0, "beta": beta})
    if form == "logistic":
        fast, slow, middle = rng.uniform(0.025, 0.035), rng.uniform(0.07, 0.11), rng.uniform(120, 260)
        return Law(form, {"floor": fast, "slow": slow, "middle": middle})
    a1, a2, a4 = rng.uniform(0.01, 0.09), rng.uniform(0.003, 0.005), rng.uniform(0.12, 0.2)
    a5, a7 = rng.uniform(0.018, 0.029), rng.uniform(0.023, 0.032)
    return Law("double", {"a1": a1, "a2": a2, "a4": a4, "a5": a5, "a7": a7})


def draw_transport(rng: np.random.Generator) -> Law:
    """The delay of a panel that a filter of its own comes on top of: scanning, bus, host."""
    return Law("constant", {"level": rng.uniform(0.02, 0.035)})
