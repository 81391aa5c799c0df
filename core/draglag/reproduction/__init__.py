"""The paper's tables and figures from simulated screens, with published numbers."""

from draglag.reproduction.measure import Reproduction, reproduce

__all__ = ["Reproduction", "reproduce"]
