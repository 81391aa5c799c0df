"""Exchanged axes and inverted light are named as such, not as runs without a latency alone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from core.sound_sessions import recorded
from draglag.analysis import analyze
from draglag.recording import Session


@pytest.fixture(scope="module")
def sound() -> Session:
    return recorded()


def said(session: Session) -> list[str]:
    return [text for text in analyze(session).warnings if text.startswith("Few runs have a sound latency")]


def test_exchanged_axes_are_named(sound: Session) -> None:
    def exchanged(session: Session) -> Session:
        runs = (replace(r, touch=replace(r.touch, x_mm=r.touch.y_mm, y_mm=r.touch.x_mm)) for r in session.runs)
        return replace(session, runs=tuple(runs))

    (sentence,) = said(exchanged(sound))
    assert "with x and y exchanged" in sentence


def test_inverted_light_is_named(sound: Session) -> None:
    runs = (replace(r, laser=replace(r.laser, light=1 - r.laser.light)) for r in sound.runs)
    (sentence,) = said(replace(sound, runs=tuple(runs)))
    assert "with the light inverted" in sentence


def test_nothing_is_named_where_neither_helps(sound: Session) -> None:
    late = (replace(r, laser=replace(r.laser, t_s=r.laser.t_s + 3.0)) for r in sound.runs)
    assert said(sound) == said(replace(sound, runs=tuple(late))) == []
