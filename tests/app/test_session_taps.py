"""Which shock belongs to which event."""

import numpy as np

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
