"""The headline of a gap report does not call noise what the line below it says is beyond chance."""

import pytest

from draglag.gap.results import GapReport, PassedOver
from draglag.report.gap import headline
from draglag_app.cli.gap import _tell

RIPPLE = PassedOver("pitch_ripple", 6e-6, "amplitude_mm 0.02 (0.01 to 0.03): too little for a name")


def report(verdict, *left):
    numbers = {"noise_floor_mm": 0.2, "gap_first_mm": 0.18, "gap_last_mm": 0.18}
    return GapReport("s", verdict, unexplained_by="x", passed_over=left, **numbers)


@pytest.mark.parametrize("verdict", ["no_gap", "explained"])
def test_only_noise_is_called_noise(verdict, capsys):
    for made in (report(verdict), report(verdict, RIPPLE)):
        _tell(made, None)
        for said in (capsys.readouterr().out, headline(made)):
            if made.passed_over:
                assert "beyond chance" in said
                assert "noise." not in said.replace("noise floor", "").split("\n")[0]
            else:
                assert "noise" in said.split("\n")[0]


def test_what_stays_unexplained_stays_so():
    assert headline(report("unexplained", RIPPLE)) == headline(report("unexplained"))
