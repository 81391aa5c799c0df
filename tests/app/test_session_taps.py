"""Which shock belongs to which event."""

import numpy as np
import pytest

from draglag.recording import Taps
from draglag_app.session.taps import TapPairer
from draglag_devices.source import ContactChanges


def shocks(*t_s):
    return Taps(np.array(t_s), np.full(len(t_s), np.nan), np.full(len(t_s), -1))


def changes(*rows):
    t_s, down = zip(*rows, strict=True)
    return ContactChanges(np.array(t_s), np.zeros(len(t_s), np.int64), np.array(down))


def paired(pairer, until_s=np.inf):
    taps = pairer.take(until_s)
    return list(zip(taps.physical_s.tolist(), taps.registered_s.tolist(), taps.down.tolist(), strict=True))


def test_each_event_takes_the_last_shock_before_it():
    pairer = TapPairer()
    pairer.add(shocks(1.0, 1.2), changes((1.03, 1), (1.23, 0)))
    assert paired(pairer) == [(1.0, 1.03, 1), (1.2, 1.23, 0)]


def test_what_finds_no_partner_is_counted():
    pairer = TapPairer()
    pairer.add(shocks(1.0, 1.01, 5.0, 9.0), changes((1.03, 1), (2.0, 0), (5.3, 1)))
    taps = pairer.take(np.inf)
    assert taps.physical_s.tolist() == [1.01]
    assert taps.rejected == {"shock": 3, "release": 1, "touch": 1}


def test_nothing_is_paired_before_both_sources_have_reported():
    pairer = TapPairer()
    pairer.add(changes=changes((1.03, 1)))
    assert paired(pairer, 1.0) == []
    pairer.add(shocks(1.0))
    assert paired(pairer, 1.1) == [(1.0, 1.03, 1)]


def test_what_a_source_rejected_is_added_up():
    pairer = TapPairer()
    ringing = Taps(np.empty(0), np.empty(0), np.empty(0, np.int64), {"ringing": 1})
    for _ in range(3):
        pairer.add(ringing)
    assert pairer.take(1.0).rejected == {"ringing": 3}
    assert pairer.take(2.0).rejected == {}


@pytest.mark.parametrize("wrong_s", [1.7e9, 60.0, -5.0])
def test_one_stamp_of_another_clock_holds_nobody_up(wrong_s):
    pairer = TapPairer()
    pairer.add(changes=changes((wrong_s, 1)), until_s=1.0)
    pairer.add(shocks(1.0, 1.2), changes((1.03, 1), (1.23, 0)), until_s=1.3)
    taps = pairer.take(1.3)
    assert taps.physical_s.tolist() == [1.0, 1.2]
    assert taps.down.tolist() == [1, 0]
    assert sum(taps.rejected.values()) == 1


def test_a_shock_of_another_clock_neither():
    pairer = TapPairer()
    pairer.add(shocks(1.7e9), until_s=1.0)
    pairer.add(shocks(1.0), changes((1.03, 1)), until_s=1.3)
    assert paired(pairer, 1.3) == [(1.0, 1.03, 1)]
