"""Constants of the posterior.

Origins: *physical* = hands, screens and sensors; *derived* = the model or numerics; *judgement* = a prior belief;
*calibrated* = sized on sessions, which are named.
"""

from __future__ import annotations

SIZE_OF_INTEREST_MM = 0.05
"""mm RMS over the edges. An effect that moves them by less is tolerated and not named. Physical: a tenth of a
millimetre peak to peak, below what any compensation of a drag can use.
"""

MISFIT_MM = (0.0, 0.001, 0.002, 0.005, 0.01, 0.02)
"""mm RMS. Scales, all alike probable, of the smooth shapes and of the columns of effects that are too small to matter:
the prior standard deviation of each. Physical: up to 0.4 of the size of interest, in steps of a factor of about two,
finer than a session knows its scale.
"""

LEAST_MISFIT_MM = 0.005
"""mm RMS. Smallest of those scales at which explanations are compared; intervals allow for all. Calibrated: at 0.001
errors of the placing by 0.3 ms were a curve of another form in two of four simulated sessions with a drift of 60 ppm.
"""

SLAB_MM = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""mm RMS. Sizes that an effect of interest may have, all alike probable. Physical: half decades from twice the size of
interest to more than clocks that drift by 15 ppm make of an hour's session (12 mm).
"""

P_EFFECT = 0.02
"""Prior probability of each effect of the library, shared by its settings. Judgement: one session in two has one."""

P_LAW_FORM = 0.2
"""Prior probability that the curve is not Eq. 5. Judgement: one screen in five."""

PROBABLE = 0.5
"""Probability from which on it is stated that nothing is there, that the curve is not Eq. 5 (fits have its own form
then), and a step without the mark of a provisional one. Derived: more probable than not.
"""

P_FALLING = 0.5
"""Prior probability that a smooth form of the curve falls with speed all along. Derived: the order of magnitude, which
weighs ln 2 nats."""

P_SMOOTH = 0.0015
"""Prior probability of each smooth term without a name. Judgement: some thirty of them, one session in twenty."""

P_JUMP = 0.006
"""Prior probability of each kind of jump without a name, shared by its places. Judgement."""

P_UNSOUND = 0.003
"""Prior probability of a session whose edges scatter by more than those of sound rigs. Judgement."""

LAW_LENGTH = 0.45
"""Of ln v. Length over which the curve's own form may change. Physical: laws change over factors of speed of 1.5."""

LAW_KNOTS = 11
"""Knots of the curve's own form, 0.2 to 0.3 of ln v apart: closer than its length. Derived."""

USUAL_SPEED_ERROR = 0.01
"""Relative error of the law's speed at an edge, where a fit begins. Physical: hands correct by 2 to 6 %, slower than a
window of speeds."""
USUAL_TREMOR_MM_S = 2.0
"""mm/s. Error of that speed by tremor, where a fit begins. Physical: 0.05 mm at 9 Hz."""
MEMORY_S = 0.5
"""s. Correlation time of a wandering lateness. Physical: a hand's pressure and tilt change within half a second."""

ROUNDING_MM = 0.001
"""mm. Rounding of the placing, whose square every variance has; also the standard deviation (RMS) of a misfit in each
direction that smooth shapes and columns of effects span, without those in which columns of 1 mm move edges by less:
such errors may be of any shape. Derived."""

LEAST_PRECISION = 1e-9
"""Of a size without a prior: a standard deviation of 30 m, 30 ks. Derived."""

HAND_STEP_S = 0.004
"""s. Within less no hand changes speed or acceleration, so that no path needs a finer grid, whatever the panel's
rate, and a local fit predicts its neighbours, but none farther off.
Physical: a hand speeds up and slows down at 1 to 4 Hz and trembles at 8 to 12 Hz."""

PADDED_S = 1.0
"""s. Before and after a trace, where it is mirrored at its ends: longer than any window. Derived."""

SEED = 20260101
"""Of draws that a report repeats: any. Derived."""

MOST_EFFECTS = 4
"""Effects that are named at most, unless the user says otherwise, and members that a set may have before it is
refitted; found effects stay and the search goes on. Derived: cost."""

DOUBT = 0.1
"""Probability from which on an alternative counts: an effect is reported as one that cannot be distinguished, and next
to what has no name effects are looked for that columns show badly. Judgement."""

ENOUGH_TAPS = 20
"""Taps below which a session shows nothing about them. Derived: a median's standard error of 0.3 of the scatter."""

WIDE_ENOUGH = 0.25
"""Share of the panel's width that edges must cover to show what follows the place. Judgement."""

BEAM = 6
"""Sets of each size that are extended. Derived: cost."""

GIVEN_UP = 8.0
"""nats. A size of sets whose best is by so much less probable than the best of all is not extended, a level of noise
not kept, a refit by so much less likely than without its last effect given up, and no lagging law refitted where every
delay is by so much less likely than those of sound panels. Derived: e⁻⁸."""

ROUNDS = 6
"""Refits and new linearisations until the most probable set stays. Derived: cost; three are usual."""

HOPELESS = 0.3
"""Share of the nats that a refit would have to gain; with less by its columns it is not made. Calibrated: refits of the
benchmark's sessions gained up to 2.6 times what columns promised."""

PROMISING = 5.0
"""nats that an effect's columns or traces gain alone, from which on it is refitted as a rival or next to what has no
name. Derived: what its name costs, and a nat for its size."""

LEAST_EDGES = 0.85
"""Share of the edges that a refit has to place. Judgement: one that loses more is no rival."""

STATED_AT_MOST = 0.99
"""Largest probability that is stated. Calibrated: fewer than a hundred sessions of a kind have been counted."""

NEXT_TO_UNNAMED = 0.5
"""Share of the names that are right where something else stays without one: the model they were compared in is
incomplete. Calibrated: 14 of 33 names, 0.42 ± 0.09 (benchmark's seeds 52901, 60817 and 291130, 478
sessions)."""

TOLERATED_SETTINGS = 4
"""Settings of an effect whose columns are tolerated, evenly over its grid. Derived: neighbours are alike."""

SHRINKS_BY = 0.02
"""Share by which the RMS on held-out runs must fall before a gap has shrunk. Judgement: a fiftieth is what a session's
own scatter moves it by."""

GROWS_BY = 0.08
"""Share by which that RMS, taken over the whole session, may grow where held-out runs are predicted better: it hangs on
single fast runs. Calibrated: of 219 kept sessions of two generators seven have such a step; right ones leave 0.66 to
0.90 of it, wrong ones 1.14 and 1.15, and one 0.65."""

PREDICTS_NATS = 3.0
"""nats of log predictive density on held-out runs from which on a model predicts them better; of log-likelihood that a
change by hand must gain before it is reported to shrink the gap. Derived: a ratio of 20."""

FEWEST_RUNS = 5
"""Runs below which neither a jackknife nor the comparison with the session simulated again is made. Derived: a standard
deviation of five is known to a third of itself."""

UNLIKELY = 1e-4
"""Probability of a statistic's value under the simulation below which the two disagree. Judgement: one session in
ten thousand by chance."""

WIDTH_SD_MM = 0.02
"""mm. By how much the stylus' width differs from run to run by itself. Physical (fact sheet on real screens)."""

MOST_SCATTER = 3.0
"""How many times as much as the simulation measured edges may scatter. Calibrated: tremor and comparator, which the
simulation does not have, make it 1.0 to 1.9 on sound sessions of two generators."""

REPEATS_AS_OFTEN = 0.05
"""Share of the events by which repeated positions may differ. Judgement: rests of the hand come and go."""
