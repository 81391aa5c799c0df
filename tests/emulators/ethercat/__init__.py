"""A software EtherCAT segment, EK1101 + EL1252, for any master over a veth pair.

``with start_segment("x") as segment:`` gives ``segment.iface`` for the master and ``segment.order(…)`` for faults and
edges. By hand: ``cd tests && python -m emulators.ethercat run`` (as root).
"""

from .netns import Segment, running_segment, start_segment, why_not

__all__ = ["Segment", "running_segment", "start_segment", "why_not"]
