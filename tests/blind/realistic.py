"""What is tried in the realistic world: sound screens of five laws, single effects, screens that no library knows."""

from .conditions import Task, sized
from .physics.effects import ACCEPTED, EFFECTS, NEW, REAL_LIBRARY, REAL_UNKNOWN, UNKNOWN
from .physics.filters.chain import SMOOTHING
from .physics.law import FORMS, VELOCITY
from .physics.rig import stream

__all__ = ["ACCEPTED", "BELOW", "quick_real_tasks", "real_tasks", "refitted"]

# Without a slope of the law these do nothing.
NEEDS_SLOPE = frozenset({"lagging_law", "low_speed_plateau"})

# Shares of the nominal size at which an effect is there and does not matter.
BELOW = {
    "speed_adaptive_filter": 0.02, "prediction": 0.1, "deadband": 0.2, "warm_up": 0.05, "beam_bow": 0.15,
}  # fmt: skip

MATTERS_MM, NEGLIGIBLE_MM = 0.1, 0.035
SPREAD = (0.7, 1.4)  # of sizes that matter, in nominal ones
# How far screens and beams go (Hz, s, mm); nothing is made larger than that to matter.
FARTHEST = {
    "speed_adaptive_filter": 0.6, "prediction": 0.02, "deadband": 0.8, "warm_up": 0.03, "beam_bow": 0.8,
    "poll_grid": 0.016, "first_order_iir": 0.06, "moving_average_by_speed": 0.24, "alpha_beta_tracker": 0.03,
}  # fmt: skip
POLLS_S = (0.004, 0.008, 0.008, 0.016)  # what hosts ask by
MICROFRAME_S = 0.000125


def real_tasks(sessions: int, seed: int, only: tuple[str, ...] = ()) -> list[Task]:
    """The realistic world's rows, `sessions` of each."""
    jobs = [("none", f"sound_{form}") for form in (*FORMS, VELOCITY)]
    jobs += [("single", name) for name in REAL_LIBRARY] + [("below", name) for name in NEW]
    jobs += [("unknown", name) for name in REAL_UNKNOWN + UNKNOWN]
    jobs = [job for job in jobs if not only or not {*job, "sound" if job[0] == "none" else job[0]}.isdisjoint(only)]
    return [
        _task(kind, row, int(stream(seed, f"real {kind} {row} {k}").integers(2**31)))
        for kind, row in jobs
        for k in range(sessions)
    ]


def quick_real_tasks(seed: int) -> list[Task]:
    """About thirty sessions without the floors' second runs: every law, every new effect, some of the others."""
    rng = stream(seed, "quick real")
    others = [name for name in REAL_LIBRARY if name not in NEW]
    jobs = [("none", f"sound_{form}") for form in FORMS for _ in range(2)]
    jobs += [("single", name) for name in (*NEW, *(str(name) for name in rng.permutation(others)[:8]))]
    jobs += [("below", str(name)) for name in rng.permutation(NEW)[:3]]
    jobs += [("unknown", name) for name in (*REAL_UNKNOWN, *(str(name) for name in rng.permutation(UNKNOWN)[:2]))]
    return [_task(kind, row, int(rng.integers(2**31)), floor=False) for kind, row in jobs]


def _task(kind: str, row: str, seed: int, floor: bool = True) -> Task:
    if kind == "none":
        return Task(kind, row, 1.0, seed, floor=floor, world="realistic", law_form=row.removeprefix("sound_"))
    forms = [form for form in FORMS if form != "constant" or row not in NEEDS_SLOPE]
    form = "transport" if row in SMOOTHING else str(stream(seed, "task's law").choice(forms))
    return Task(kind, row, 1.0, seed, _sizes(kind, row, seed), floor=floor, world="realistic", law_form=form)


def _sizes(kind: str, row: str, seed: int) -> dict[str, float]:
    rng = stream(seed, "task's size")
    if row == "poll_grid":  # hosts ask at whole multiples of their bus's frames
        return {row: MICROFRAME_S if kind == "below" else float(rng.choice(POLLS_S))}
    if kind == "below":
        return sized((row,), BELOW[row], seed)
    return sized((row,), rng.uniform(*SPREAD) if row in NEW + REAL_UNKNOWN else 1.0, seed)


def refitted(task: Task, gap_mm: float) -> dict[str, float] | None:
    """Sizes at which effects matter, or do not, as intended; None where they are well as drawn.

    gap_mm: the gap of one effect at the size drawn. Effects of the plain world stay as drawn.
    """
    if len(task.effects) != 1 or gap_mm <= 0:
        return None
    ((name, size),) = task.effects.items()
    if task.kind == "below" and gap_mm > NEGLIGIBLE_MM:
        factor = 0.8 * NEGLIGIBLE_MM / gap_mm
    elif task.kind != "below" and name in NEW + REAL_UNKNOWN and gap_mm < MATTERS_MM:
        most = FARTHEST[name] / abs(size)
        factor = min(1.2 * MATTERS_MM / gap_mm, max(1 / most if EFFECTS[name].inverse else most, 1.0))
    else:
        return None
    return {name: size / factor if EFFECTS[name].inverse else size * factor}
