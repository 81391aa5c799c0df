"""Every text of the windows is translated, with the same places for numbers."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PySide6.QtCore import QCoreApplication, QLibraryInfo
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QApplication

from draglag.analysis import AnalysisOptions, analyze
from draglag.curve import FORMS
from draglag.errors import DataError
from draglag.gap.by_hand import BY_HAND
from draglag.gap.fitting.parameters import where_of
from draglag.gap.posterior.levels import NOISE
from draglag.gap.results import FOLLOWS
from draglag.latency import RunEstimate
from draglag.latency.flags import MEANING
from draglag.latency.on_clock import warnings_of
from draglag.messages import chained, message
from draglag.recording import ClockBounds, Session, empty_touch
from draglag.simulation.effects import EFFECTS
from draglag_app.windows.pages.parts.gap_steps import StepTable, remarks, unseen
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.button_words import IN_BUTTONS
from draglag_app.windows.wording.effect_words import (
    EFFECT_NAMES,
    PARAMETER_NAMES,
    effect_meaning,
    effect_name,
    size_words,
)
from draglag_app.windows.wording.gap_words import _FOLLOWS, headline, law_words
from draglag_app.windows.wording.i18n import language_of, table_of, use_language
from draglag_app.windows.wording.library_words import in_words
from message_templates import example, has_words, sentences, texts_of_windows

LANGUAGES = ("nl",)


def texts() -> set[str]:
    """Every string that the windows pass to a translating function, and what they show of the library's tables."""
    found = texts_of_windows()
    found |= {form.title for form in FORMS.values()} | set(MEANING.values())
    found |= {effect.meaning for effect in EFFECTS.values()} | set(EFFECT_NAMES.values())
    found |= PARAMETER_NAMES
    return found | {flag.replace("_", " ") for flag in MEANING}


@pytest.mark.parametrize("language", LANGUAGES)
def test_translation_is_whole(language: str) -> None:
    table = table_of(language)
    assert sorted(texts() - set(table)) == []


# Of these no window asks for anything: recordings of other programs, the paper's figures, the command line.
_NO_WINDOW = (
    "draglag/exchange/importers", "draglag/reproduction", "draglag_app/cli", "draglag_app/lsl", "draglag_app/parallel",
)  # fmt: skip


def library_templates() -> set[str]:
    """The template of every message of core, devices and app that a window may show, in the windows' words."""
    found = {s.template for s in sentences() if s.template and not s.file.startswith(_NO_WINDOW)}
    found |= {text for effect in EFFECTS.values() for text in (effect.where, effect.separated_by) if text}
    found |= {effect.identifiable_with for effect in EFFECTS.values() if effect.identifiable_with}
    return {IN_BUTTONS.get(text, text) for text in found if has_words(text)}


def test_every_sentence_is_a_literal_or_made_of_one() -> None:
    assert [f"{s.file}:{s.line}" for s in sentences() if s.template is None] == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_message_is_translated(language: str) -> None:
    known = library_templates()
    assert len(known) > 600
    assert sorted(known - set(table_of(language))) == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_is_filled_in_is_written_the_same_way(language: str) -> None:
    for text, translated in table_of(language).items():
        assert set(re.findall(r"{\w+[^}]*}", text)) == set(re.findall(r"{\w+[^}]*}", translated)), text


@pytest.mark.parametrize("name", ["{run}", "{path}: is a folder", "{", "laser", "Permission denied"])
def test_arguments_that_look_like_templates_are_shown_as_they_are(qapp: QApplication, name: str) -> None:
    error = DataError(message("{path}: is a folder", path=name), "Name a file in it")
    nested = message("{role} stopped working ({why})", role="laser", why=error.message)
    try:
        use_language(qapp, "nl")
        assert in_words(error.message) == f"{name}: is een map. Noem een bestand erin."
        assert in_words(nested) == f"lasersensor werkt niet meer ({name}: is een map. Noem een bestand erin.)"
        assert in_words(pickle.loads(pickle.dumps(error)).message) == in_words(error.message)
        assert in_words("{run}: no latency ({flags})") == "{run}: no latency ({flags})"
    finally:
        use_language(qapp, "en")
    assert in_words(error.message) == str(error) == f"{name}: is a folder. Name a file in it."


def test_what_stands_in_a_sentence_is_named_as_elsewhere_in_the_windows(qapp: QApplication) -> None:
    roles = chained("{before} and a {next}", (message("{role}", role=role) for role in ("touch", "laser")))
    needs = message("needs a {roles} source", roles=roles)
    refused = message("{effect} cannot be fitted to edges", effect="clock_drift")
    try:
        use_language(qapp, "nl")
        assert in_words(needs) == "heeft als bron nodig: aanraakscherm en lasersensor"
        assert in_words(refused) == "klokverloop kan niet op flanken worden gepast"
    finally:
        use_language(qapp, "en")
    assert in_words(needs) == "needs a touchscreen and a laser sensor source"
    assert in_words(refused) == "clock drift cannot be fitted to edges"


def test_pages_say_in_dutch_why_something_is_refused(qapp: QApplication, open_window: Callable, tmp_path: Path) -> None:
    empty = tmp_path / "empty.toml"
    empty.write_text('name = "empty"\n')
    try:
        window = open_window(language="nl")
        protocol = window.space.protocol
        large = protocol.runs[0].model_copy(update={"radius_fraction": 0.45})
        window.space.set_protocol(protocol.model_copy(update={"runs": (large,)}))
        assert "het doel cirkel verlaat het scherm" in window.pages["protocol"][1].preview.words.text()
        window.pages["protocol"][1]._load_from(empty)
        assert window.notice_text.text() == (
            f"{empty}, regel 1: een protocol heeft minstens een van [[runs]], [taps] en [clock_check] nodig; "
            "verbeter het bestand."
        )
        off = message("target {target} is off by {off_mm:.1f} mm after the fit (limit {limit_mm:.1f} mm)",
                      target=5, off_mm=12.0, limit_mm=2.0)  # fmt: skip
        verdict = window.geometry_page.calibration.verdict
        window.space.calibrating.refused.emit(DataError(off).message)
        dutch = "doel 5 ligt na de fit 12.0 mm ernaast (grens 2.0 mm)."
        assert verdict.text() == window.notice_text.text() == dutch
    finally:
        use_language(qapp, "en")


def library_sentences(session: Session, estimates: tuple[RunEstimate, ...]) -> list[str]:
    """What the library says of a session whose clocks are in doubt in every way, and of one without a curve."""
    unsure = replace(estimates[0], flags=("clock_uncertain",), clock_uncertainty_s=3e-3)
    unknown = replace(estimates[1], flags=("clock_unknown",), clock_uncertainty_s=None)
    twisted = ClockBounds(
        "laser", np.arange(3.0), np.array([0.0, 1.2, 2.0]), np.array([1e-4, 1.2001, 2.0001]), np.zeros(3, np.int64)
    )
    drifting = ClockBounds(
        "laser", np.arange(3.0), 1.0001 * np.arange(3.0), 1.0001 * np.arange(3.0) + 1e-6, np.zeros(3, np.int64)
    )
    said = []
    for clock in (twisted, drifting):
        alone = replace(session, runs=(), clocks=(clock,))
        said += warnings_of(alone, (unsure, unknown), {"WALT": 2e-3})
    few = replace(session, runs=session.runs[:1])
    for form in ("best", "double_exponential", "constant"):
        said += analyze(few, AnalysisOptions(form=form, tie_asymptote=True)).problems
    none = replace(session.runs[0], touch=empty_touch())
    said += analyze(replace(session, runs=(none,), taps=None), AnalysisOptions(tie_asymptote=True)).problems
    return said


def test_what_the_library_says_is_dutch_too(qapp: QApplication, opened: OperatorWindow) -> None:
    space = opened.space
    said = library_sentences(space.session, space.analysis.runs)
    assert len(said) > 8
    try:
        use_language(qapp, "nl")
        for sentence in said:
            dutch = in_words(sentence)
            assert dutch != sentence, sentence
            assert "{" not in dutch
            # Numbers and names are those of the sentence.
            assert set(re.findall(r"\d+\.\d+|run-\d+", dutch)) == set(re.findall(r"\d+\.\d+|run-\d+", sentence))
    finally:
        use_language(qapp, "en")
    assert [in_words(sentence) for sentence in said] == [text.replace("(no_touch)", "(no touch)") for text in said]


def test_windows_speak_dutch(qapp: QApplication, open_window: Callable) -> None:
    try:
        window = open_window(language="nl")
        assert window.navigation.tabs["record"].text() == table_of("nl")["Record"]
        assert window.actions_table.made["start"].text() == table_of("nl")["Start measuring"]
        assert (
            window.actions_table.made["go_bench"].shortcut().toString(QKeySequence.SequenceFormat.NativeText)
            == "Ctrl+1"
        )
        assert QCoreApplication.translate("QFileDialog", "A text of Qt's own") == "A text of Qt's own"
        assert "laserstraal" in window.pages["help"][1].manual.toPlainText()
    finally:
        use_language(qapp, "en")


def test_unknown_languages_are_english() -> None:
    assert language_of("xx") == "en"
    assert table_of("xx") == {}


def test_what_the_gap_page_says_is_dutch(qapp: QApplication) -> None:
    assert {k: _FOLLOWS[k] for k in FOLLOWS} == FOLLOWS
    reasons = {effect.separated_by for effect in EFFECTS.values() if effect.separated_by} | {
        "1 run at an even speed with edges: at least 5 are needed",
        "1 drag speed: at least 4, spread over a factor of 3, are needed",
        "no run at an even speed shows where the stylus was: its touch positions are missing or not numbers",
        example(
            "edges and touch events of {n} of {of} runs at an even speed lie at different times: both have to be on "
            "one clock"
        ),
        example("touch times of {runs} go back or are no numbers: exported and imported again they are put in order"),
        example("runs that give a latency: {n}, at least 5 are needed"),
        "a fixed trail hides in the latency law: a tap or a second stylus shows it",
        "taps timed on the same clock show it",
        "circles that travel across the whole width show it",
    }
    by_taps = message("release taps lie {ms:+.1f} ms off the fitted asymptote", ms=6.4)
    fit = SimpleNamespace(law=SimpleNamespace(plateau_mm_s=118.0), terms=())
    places = {where_of(effect, fit) for effect in (*BY_HAND, "low_speed_plateau")}  # type: ignore[arg-type]
    places |= {
        example("in {n} stretches of time, {seconds:.0f} s in all"),
        example("{share:.0f} % of edges"),
        "every frame",
        "every stamp",
        "every edge alike",
    }
    places |= {
        "every edge alike",
        "straight lines in the trace",
        "every tick of the host's loop",
        example("{n:.2g} frames at a time, all through"),
    }
    alike, run = ["thermal_drift"], EFFECTS["clock_drift"].separated_by
    sets = [(["clock_drift"], 0.5), (["beam_bow", "clock_drift"], 0.2), ([], 0.15), (["unexplained"], 0.12)]
    drift = {"drift_ppm": {"value": 24.9, "ci95": [23.7, 26.2]}}
    report = {
        "verdict": "explained", "gap_first_mm": 2.7, "gap_last_mm": 0.2, "noise_floor_mm": 0.2,
        "steps": [
            {"effect": "clock_drift", "indistinguishable_from": alike, "extra_run": run, "evidence": {},
             "parameters": drift, "probability": 0.9},
            {"effect": "clock_offset", "covariate": "taps", "evidence": {"text": by_taps}, "parameters": {},
             "probability": 0.95},
        ],
        "explanations": [{"effects": names, "probability": p} for names, p in sets],
        "law": {"adequate": False, "misses_ms": 1.21, "probability_other": 0.97},
        "tolerated": [{"follows": "session_time", "probability": 0.9, "size_mm": 0.031}],
        "noise": [{"name": name, "level": 0.1, "size_mm": 0.1} for name in ("touch", *NOISE)],
        "not_seen": {"clock_offset": "taps timed on the same clock show it"},
    }  # fmt: skip
    try:
        use_language(qapp, "nl")
        assert [text for text in reasons | places if in_words(text) == text] == []
        said = remarks(report, (), ())
        assert said == [
            "Ook mogelijk: bocht in de straal en klokverloop (kans 0.20), geen effect (kans 0.15), iets zonder naam "
            "(kans 0.12)",
            "klokverloop of kruipende vertraging: tikken voor en na de runs onderscheiden een verlopende klok van een "
            "kruipende vertraging",
            "klokverschil: loslaattikken liggen +6.4 ms naast de asymptoot van de fit",
            "Toegestaan, te klein om ertoe te doen: de sessietijd, 0.03 mm",
            "Ruis van de flanken, zo groot als de sessie die heeft: ruis van de aanraking 0.10 mm, trage aanraakruis "
            "0.10 mm, fouten van de snelheid 0.10 mm, beven 0.10 mm, snelheidsveranderingen ongelijk gevolgd 0.10 mm, "
            "vertraging van run tot run 0.10 mm, verschuiving van run tot run 0.10 mm, late losse meldingen 0.10 mm, "
            "vertraging die zwerft 0.10 mm",
        ]
        assert unseen(report) == ["klokverschil: tikken op dezelfde klok laten het zien"]
        assert law_words(report) == (
            "De kromme is niet vergelijking 5: die ligt er 1.2 ms RMS naast (kans 0.97); zie Resultaten voor de vorm "
            "die past."
        )
        assert headline(report) == (
            "Klokverloop of kruipende vertraging 24.9 ppm (23.7 tot 26.2; kans 0.90) verklaart het verschil: "
            "2.70 → 0.20 mm, ruis 0.20. Klokverschil (kans 0.95), volgens de tikken. "
            "Wat meer is dan toeval, is te klein om ertoe te doen."
        )
    finally:
        use_language(qapp, "en")


def test_a_probable_cause_that_is_not_in_the_model_is_named(qapp: QApplication) -> None:
    report = {
        "verdict": "unexplained", "gap_first_mm": 0.16, "gap_last_mm": 0.16, "noise_floor_mm": 0.12, "steps": [],
        "unexplained_by": "normal_acceleration",
        "explanations": [{"effects": ["smoothing_shrink"], "probability": 0.97}],
    }  # fmt: skip
    assert headline(report) == (
        "Unexplained: a gap remains that follows the normal acceleration; the most probable cause, smoothing that "
        "shrinks (probability 0.97), is not in the model: held-out runs have to support an effect."
    )
    try:
        use_language(qapp, "nl")
        assert "de waarschijnlijkste oorzaak, " in headline(report)
    finally:
        use_language(qapp, "en")


def test_effects_and_their_parameters_have_dutch_names(qapp: QApplication) -> None:
    assert set(EFFECT_NAMES) == set(EFFECTS)
    try:
        use_language(qapp, "nl")
        assert effect_name("clock_drift") == "klokverloop"
        for effect in EFFECTS:
            assert effect_meaning(effect).endswith(f"({effect})")
            assert effect_meaning(effect) != f"{EFFECTS[effect].meaning} ({effect})"
        assert size_words("second_filter_mode", "extra_s", 0.012, (0.0115, 0.0125)) == "extra 12 ms (11.5 tot 12.5)"
        assert size_words("smoothing_shrink", "time_constant_s", 0.02) == "tijdconstante 20 ms"
    finally:
        use_language(qapp, "en")
    assert effect_name("clock_drift") == "clock drift"


def test_the_dialogs_of_qt_are_dutch_where_qt_is(qapp: QApplication) -> None:
    assert QCoreApplication.translate("QFileDialog", "File &name:") == "File &name:"
    try:
        use_language(qapp, "nl")
        if not Path(QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath), "qtbase_nl.qm").is_file():
            pytest.skip("this Qt comes without translations")
        assert "naam" in QCoreApplication.translate("QFileDialog", "File &name:")
    finally:
        use_language(qapp, "en")
    assert QCoreApplication.translate("QFileDialog", "File &name:") == "File &name:"


def test_where_an_effect_acts_is_said_in_the_language_of_the_window(qapp: QApplication) -> None:
    where = message("in {n} stretches of time, {seconds:.0f} s in all", n=3, seconds=12.0)
    step = {"effect": "second_filter_mode", "probability": 0.99, "where": where, "parameters": {}}
    step |= {"gap_before_mm": 0.4, "gap_after_mm": 0.1}
    report = {"steps": [step], "explanations": []}
    try:
        use_language(qapp, "nl")
        table = StepTable()
        table.show_report(report)
        shown = table.item(0, 2)
    finally:
        use_language(qapp, "en")
    assert shown is not None
    assert shown.text() == "in 3 stukken tijd, samen 12 s"
