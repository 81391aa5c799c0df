"""An estimator from a package of its own is used by name, checked, and named where it fails."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from plugins import example, installed, python, with_packages

SAMPLE = Path(__file__).parents[2] / "data" / "exchange" / "none-A"
TRUTH = json.loads((SAMPLE.parent / "labels.json").read_text())["none-A"]["runs"]
GROUP = "draglag.estimators"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return example("draglag-least-absolute", GROUP, tmp_path_factory.mktemp("site"))


def test_the_example_estimates_the_latency_that_was_there(site: list[Path]) -> None:
    done = with_packages(site, "analyze", SAMPLE, "--estimator", "least-absolute", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["estimator"] == "least-absolute"
    errors = {run["id"]: run["latency_ms"] - TRUTH[run["id"]]["true_latency_ms"] for run in found["runs"]}
    assert len(errors) == 13
    assert max(map(abs, errors.values())) < 3, errors
    assert found["curve"]["rms_ms"] < 2


def test_it_is_used_in_python_by_the_same_name(site: list[Path]) -> None:
    code = f"""
import draglag as dl
analysis = dl.analyze(dl.read({str(SAMPLE)!r}), estimator="least-absolute")
print(analysis.runs[0].latency_ms)
"""
    done = python(site, code)
    first = TRUTH["run-01"]["true_latency_ms"]
    assert float(done.stdout) == pytest.approx(first, abs=3)


def test_without_its_package_the_names_that_there_are_are_said() -> None:
    done = with_packages([], "analyze", SAMPLE, "--estimator", "least-absolute")
    assert done.returncode == 2
    assert "'least-absolute' is not one of 'efficient', 'paper'" in done.stderr


@pytest.mark.parametrize(
    ("name", "source", "said"),
    [
        ("paper", "def one(*_): pass", "its name is taken"),
        ("mine", "one = 3", "it is no function"),
        ("mine", "raise RuntimeError('broken')", "RuntimeError: broken"),
    ],
)
def test_one_that_cannot_be_used_is_left_out_with_a_warning(tmp_path: Path, name: str, source: str, said: str) -> None:
    (tmp_path / "strange.py").write_text(source)
    code = "from draglag.latency.estimators import estimator_names; print(*estimator_names())"
    done = python([installed(tmp_path, {name: "strange:one"}, GROUP)], code)
    assert done.stdout.split() == ["efficient", "paper"]
    assert f"estimator {name} (strange:one) is left out" in done.stderr
    assert said in done.stderr


@pytest.mark.parametrize("source", ["def one(*_): return 1 / 0", "def one(*_): return 0.05"])
def test_one_that_fails_is_named_in_one_sentence(tmp_path: Path, source: str) -> None:
    (tmp_path / "strange.py").write_text(source)
    done = with_packages(
        [installed(tmp_path, {"mine": "strange:one"}, GROUP)], "analyze", SAMPLE, "--estimator", "mine"
    )
    assert done.returncode == 1
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert "run-01: the estimator mine failed (" in line


@pytest.mark.parametrize("figures", ["latency_s=math.nan, speed_mm_s=100.0", "latency_s=math.inf, speed_mm_s=100.0",
                                     "latency_s=0.05, speed_mm_s=math.nan", "latency_s=0.05"])  # fmt: skip
def test_a_latency_that_is_no_number_is_none(tmp_path: Path, figures: str) -> None:
    (tmp_path / "strange.py").write_text(
        "import math\nfrom dataclasses import replace\n"
        "def one(ready, blank, window_s):\n"
        f"    return replace(blank, {figures}, latency_se_s=1e-3, latency_ci95_s=(0.04, 0.06), flags=('few_edges',))\n"
    )
    code = f"""
import json, draglag as dl
print(json.dumps(dl.analyze(dl.read({str(SAMPLE)!r}), estimator="mine").to_dict(), allow_nan=False))
"""
    found = json.loads(python([installed(tmp_path, {"mine": "strange:one"}, GROUP)], code).stdout)
    assert (len(found["runs"]), found["curve"]) == (13, None)
    for run in found["runs"]:
        assert (run["latency_ms"], run["latency_ci95_ms"], run["in_curve"]) == (None, None, False)
        assert {"few_edges", "unidentifiable"} <= set(run["flags"])
