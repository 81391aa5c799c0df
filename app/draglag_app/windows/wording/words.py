"""Numbers and states in the operator's words."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QCoreApplication

from draglag.curve import FORMS
from draglag.latency import RunEstimate
from draglag.latency.conduct import is_usable
from draglag.latency.flags import MEANING
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP

DASH = "–"
# Below the first an interval is written with another digit; none is written narrower than the second.
_SURE_S, _LEAST_S = 0.05e-3, 0.01e-3
TARGETS = {
    "circle": QT_TRANSLATE_NOOP("Words", "circle"),
    "chirp": QT_TRANSLATE_NOOP("Words", "chirp"),
    "multisine": QT_TRANSLATE_NOOP("Words", "multi-sine"),
    "step": QT_TRANSLATE_NOOP("Words", "step"),
    "free": QT_TRANSLATE_NOOP("Words", "free"),
    "tap": QT_TRANSLATE_NOOP("Words", "tap"),
}
OUTCOMES = {
    "complete": QT_TRANSLATE_NOOP("Words", "complete"),
    "aborted": QT_TRANSLATE_NOOP("Words", "aborted"),
    "device_lost": QT_TRANSLATE_NOOP("Words", "device lost"),
    "failed": QT_TRANSLATE_NOOP("Words", "failed"),
}


def say(text: str) -> str:
    """A text of this file, translated."""
    return QCoreApplication.translate("Words", text)


def target_name(kind: str) -> str:
    return say(TARGETS.get(kind, kind))


DETAILS = {
    "participant": QT_TRANSLATE_NOOP("Words", "participant"),
    "session": QT_TRANSLATE_NOOP("Words", "session"),
    "operator": QT_TRANSLATE_NOOP("Words", "operator"),
}


def detail_name(name: str) -> str:
    """The name of a session's detail."""
    return say(DETAILS[name]) if name in DETAILS else name.replace("_", " ")


PRESETS = (
    QT_TRANSLATE_NOOP(
        "Words", "A whole session: circles at 12 speeds, chirp, multi-sine, step, taps and clock checks."
    ),
    QT_TRANSLATE_NOOP(
        "Words", "Circles at 16 speeds from 44 to 1000 mm/s in shuffled order, 40 s each: the latency curve."
    ),
    QT_TRANSLATE_NOOP(
        "Words", "Two minutes of clock comparisons between the host and every device; nobody touches the screen."
    ),
    QT_TRANSLATE_NOOP(
        "Words",
        "Two minutes: circles at 5 speeds from 80 to 1000 mm/s. Is everything set up right, and how large is the "
        "latency about?",
    ),
)


def preset_meaning(description: str) -> str:
    """A protocol's description; presets' translated."""
    return say(description) if description else ""


def outcome_name(outcome: str) -> str:
    return say(OUTCOMES.get(outcome, outcome))


def form_name(form: str) -> str:
    return say(FORMS[form].title) if form in FORMS else form


def number(value: float | None, digits: int = 1) -> str:
    """A number, or a dash."""
    return DASH if value is None or value != value else f"{value:.{digits}f}"


def between(low: str, high: str) -> str:
    """The ends of an interval."""
    return say("{low} to {high}").format(low=low, high=high)


def per_second(rate_hz: float) -> str:
    return f"{rate_hz:.0f} /s"


def duration_ms(value_s: float) -> str:
    """A short time in ms, from a second on in s."""
    return f"{1e3 * max(0.0, value_s):.0f} ms" if value_s < 1.0 else f"{value_s:.1f} s"


def ms(value_s: float | None, digits: int = 1) -> str:
    """Seconds as milliseconds, without the unit."""
    return number(None if value_s is None else 1e3 * value_s, digits)


def latency_text(estimate: RunEstimate) -> str:
    """Latency with half its 95 % interval."""
    if estimate.latency_s is None:
        return DASH
    if estimate.latency_ci95_s is None:
        return f"{ms(estimate.latency_s)} ms"
    half_s = (estimate.latency_ci95_s[1] - estimate.latency_ci95_s[0]) / 2
    digits = 1 if half_s >= _SURE_S else 2  # "± 0.0" would claim that nothing is uncertain
    return f"{ms(estimate.latency_s, digits)} ± {ms(max(half_s, _LEAST_S), digits)} ms"


def verdict(estimate: RunEstimate) -> tuple[str, str]:
    """(level, words): "ok", "warning" or "bad"."""
    level, names = verdict_parts(estimate)
    return level, ", ".join(names)


def verdict_parts(estimate: RunEstimate) -> tuple[str, list[str]]:
    """As ``verdict``, with single flags, most important first."""
    names = [flag_name(flag) for flag in estimate.flags]
    if not is_usable(estimate):
        without = say("no latency") if estimate.latency_s is None else say("no standard error")
        return "bad", names or [without]
    return ("warning", names) if names else ("ok", [say("good")])


def flag_name(flag: str) -> str:
    return say(flag.replace("_", " "))


def flag_meanings(flags: tuple[str, ...]) -> str:
    """What the flags mean, a line each."""
    return "\n".join(f"{flag_name(flag)}: {say(MEANING.get(flag, flag))}" for flag in flags)


def clock_words(estimates: Sequence[RunEstimate]) -> str:
    """Effects of the clocks on latencies; else empty."""
    unsure = [e for e in estimates if "clock_uncertain" in e.flags and e.clock_uncertainty_s is not None]
    unknown = [e for e in estimates if "clock_unknown" in e.flags]
    said = []
    if unsure:
        worst = max(e.clock_uncertainty_s or 0.0 for e in unsure)
        text = say("The laser's clock is known to ±{worst} ms only in {runs}: above 1 ms it matters.")
        said.append(text.format(worst=ms(worst, 2), runs=", ".join(e.id for e in unsure[-3:])))
    if unknown:
        text = say("The laser's clock was not compared with the computer's in {runs}.")
        said.append(text.format(runs=", ".join(e.id for e in unknown[-3:])))
    return " ".join(said)


def size(n_bytes: float) -> str:
    """Bytes for people."""
    for unit in ("B", "kB", "MB", "GB"):
        if n_bytes < 1000:
            return f"{n_bytes:.0f} {unit}" if unit in ("B", "kB") else f"{n_bytes:.1f} {unit}"
        n_bytes /= 1000
    return f"{n_bytes:.1f} TB"


def duration(seconds: float) -> str:
    """A time as "m:ss", from an hour on "h:mm:ss"."""
    whole = max(0, round(seconds))
    if whole >= 3600:
        return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"
    return f"{whole // 60}:{whole % 60:02d}"
