"""The check of the rig, in the operator's words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from PySide6.QtCore import QCoreApplication

from draglag.errors import DraglagError
from draglag.messages import joined
from draglag_app.preflight import Check
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP
from draglag_app.windows.wording.library_words import in_words, source_name

MARKS = {"ok": "✓", "warning": "▲", "fault": "✕"}
_NAMES = {
    "addresses": QT_TRANSLATE_NOOP("Check", "addresses"),
    "disk": QT_TRANSLATE_NOOP("Check", "disk"),
    "touch size": QT_TRANSLATE_NOOP("Check", "touch size"),
    "touch fuzz": QT_TRANSLATE_NOOP("Check", "touch fuzz"),
    "touch events": QT_TRANSLATE_NOOP("Check", "touch events"),
    "laser edges": QT_TRANSLATE_NOOP("Check", "laser edges"),
    "laser clock": QT_TRANSLATE_NOOP("Check", "laser's clock"),
    "laser drift": QT_TRANSLATE_NOOP("Check", "drift of the laser's clock"),
    "walt clock": QT_TRANSLATE_NOOP("Check", "WALT's clock"),
    "walt drift": QT_TRANSLATE_NOOP("Check", "drift of the WALT's clock"),
}


def say(text: str) -> str:
    return QCoreApplication.translate("Check", text)


@dataclass(frozen=True)
class Checked:
    """A device's light and sentence; ``text`` is the library's."""

    role: str
    state: str
    text: str


def light_of(role: str, checks: Sequence[Check]) -> Checked:
    """What the light of a device shows.

    What was measured only while nobody drew is no matter of the light: faults are, and what the device itself reports.
    """
    own = [check for check in checks if check.name == role]
    faults = [check for check in checks if check.state == "fault" and check.name.split()[0] in (role, "addresses")]
    if faults:
        return Checked(role, "fault", DraglagError(faults[0].measured, faults[0].remedy).message)
    state = "warning" if any(check.state == "warning" for check in own) else "ready"
    return Checked(role, state, joined(" · ", [check.measured for check in own]))


def check_html(check: Check) -> str:
    """Mark, name, value and limit of one check, and below what to do."""
    name = say(_NAMES[check.name]) if check.name in _NAMES else source_name(check.name)
    line = f"<b>{MARKS[check.state]} {escape(name)}</b> &nbsp; {escape(in_words(check.measured))}"
    if check.limit:
        line += " " + escape(say("(limit {limit})").format(limit=in_words(check.limit)))
    return line + (f"<br>&nbsp;&nbsp;&nbsp;→ {escape(in_words(check.remedy))}" if check.remedy else "")


def summary(checks: Sequence[Check]) -> tuple[str, str]:
    """(level, sentence) of a whole check."""
    faults, remarks = (sum(check.state == state for check in checks) for state in ("fault", "warning"))
    if faults:
        words = say("Not ready: {n} of {of} checks failed. The page Bench lists what to do.")
        return "warning", words.format(n=faults, of=len(checks))
    answers = say("Checked: every instrument answers.")
    if not remarks:
        return "info", answers
    return "warning", answers + " " + say("The page Bench lists what to look at: {n} of {of}.").format(
        n=remarks, of=len(checks)
    )
