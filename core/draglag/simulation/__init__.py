"""The simulated measuring rig: ``simulate_session``; for one run ``follow`` and ``simulate_run``."""

from draglag.simulation.chain import (
    RunTruth,
    SimulationTruth,
    simulate_run,
    simulate_run_with_truth,
    simulate_session,
    simulate_session_with_truth,
)
from draglag.simulation.hand import PERFECT, Human, follow
from draglag.simulation.kinematics import Kinematics, Motion
from draglag.simulation.law import LatencyLaw
from draglag.simulation.rig import Rig, rig_for_screen
from draglag.simulation.taps import simulate_taps

__all__ = [
    "PERFECT",
    "Human",
    "Kinematics",
    "LatencyLaw",
    "Motion",
    "Rig",
    "RunTruth",
    "SimulationTruth",
    "follow",
    "rig_for_screen",
    "simulate_run",
    "simulate_run_with_truth",
    "simulate_session",
    "simulate_session_with_truth",
    "simulate_taps",
]
