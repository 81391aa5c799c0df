"""How long the EtherCAT laser waits for what, and how often it looks; the unit stands in the name.

Where no origin is given, the value was chosen without a measurement.
"""

from __future__ import annotations

# --- one frame ---
# For the answer to a cycle. SOEM's socket waits in ticks of the kernel: a lost frame costs 8-12 ms whether 0.5 or 5 ms
# are asked, so the longer patience is free and spares frames that a busy machine handles late.
ANSWER_US = 5000
# For the answer to a frame of discovery, on a line of which nothing is known.
PROBE_ANSWER_S = 0.03
# For one of the two frames that show whether a lost line answers again. SOEM takes many seconds to give up on a line
# that is dead or slow.
PROMPT_ANSWER_S = 0.005

# --- the running bus ---
# Period: one stamp for each direction and cycle is what the terminal can do.
CYCLE_NS = 1_000_000
# Between questions for the state of the devices, comparisons of clocks, reports of time, and summaries of cycles.
STATE_EVERY_NS, CLOCK_EVERY_NS, TICK_EVERY_NS, SUMMARY_EVERY_NS = 100_000_000, 250_000_000, 10_000_000, 1_000_000_000
# Pause between cycles above which edges may be missing: one and a half periods.
STALL_NS = 3 * CYCLE_NS // 2
# Pause over which nothing is known for sure: one and a half of STATE_EVERY_NS.
UNWATCHED_NS = 3 * STATE_EVERY_NS // 2
# Pause that is worth a word; shorter ones happen all the time, and what they leave in doubt is marked.
DELAYED_NS = 50_000_000
# Between reports of the time without data while the bus is lost.
DEAD_GAP_NS = 1_000_000_000

# --- bringing the bus up ---
# For one request of a state, which is repeated, and for the state altogether.
STATE_REQUEST_US = 100_000
STATE_S = 1.0
# Without progress, by the number of bring-ups ended for it: one that works needs 0.1 s, but a line of many devices on
# a busy computer must get its chance, and SOEM can read an EEPROM byte by byte for half a minute.
SILENCE_S = (1.0, 1.0, 2.0, 2.0, 4.0, 8.0, 30.0)
# Between bring-ups that fail, and between questions whether the line answers at all, which disturb nobody.
PAUSES_S = (0.01, 0.01, 0.02, 0.02, 0.05, 0.05, 0.1, 0.1, 0.2, 0.2, 0.5)
PROBE_PAUSES_S = (0.01, 0.01, 0.02, 0.02, 0.05, 0.05, 0.1)
# A life of the bus shorter than this was no real one: the pauses go on growing.
LONG_S = 2.0

# --- processes ---
# Between looks at the process that runs the bus.
POLL_S = 0.1
# For a word of a running bus, which reports every TICK_EVERY_NS.
STUCK_S = 3.0
# For the end of the process that runs the bus, asked by closing its input; then it is killed.
EXIT_S = 1.0
# For the lock of an earlier helper that crashed, which may take a moment to let go of everything; between tries.
INHERIT_S = 3.0
CLAIM_PAUSE_S = 0.01
# For a bus that is ready, seen from the session; between looks meanwhile.
OPEN_S = 20.0
MESSAGE_S = 0.5
# For the end of the helper, asked by closing its pipes, and again after it was killed.
CLOSE_S = 3.0
# For the answers of all interfaces to a discovery.
DISCOVERY_S = 10.0
# For the kernel's list of addresses.
ADDRESSES_S = 1.0
