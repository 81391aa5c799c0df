"""Fixtures that several files share."""

from devices.ethercat_rig import segment, wired

__all__ = ["segment", "wired"]
