"""The paper's tables and figures from simulated Screens 1 and 2, with published numbers."""

from draglag.reproduction.measure import Reproduction, reproduce

__all__ = ["Reproduction", "reproduce"]
