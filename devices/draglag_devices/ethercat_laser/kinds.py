"""Known EtherCAT devices; listing them needs no pysoem."""

from __future__ import annotations

BECKHOFF = 0x2
# Revisions differ between lots and do not matter. The EK1100 is an EK1101 without the ID switch: it has no process
# data, and neither the counter nor the EL1252's part of the image is written down here; both follow from the line.
EK1101, EK1100, EL1252 = 0x044D2C52, 0x044C2C52, 0x04E43052
COUPLERS = (EK1101, EK1100)
