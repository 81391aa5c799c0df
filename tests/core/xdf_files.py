"""XDF 1.0 files, chunk by chunk."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

BOUNDARY = struct.pack("<H", 5) + bytes.fromhex("43a546dccbf5410fb30ed5467383cbe4")


def xdf_file(chunks: Sequence[bytes]) -> bytes:
    """A file of these chunks, each its tag (u16) and its content; their lengths are put before them."""
    return b"XDF:" + b"".join(struct.pack("<BI", 4, len(chunk)) + chunk for chunk in chunks)


def head(stream: int, name: str, labels: Sequence[str], kind: str = "double64", count: int | None = None) -> bytes:
    """The head of a stream; ``count`` of channels, where it is not that of the labels."""
    channels = "".join(f"<channel><label>{label}</label></channel>" for label in labels)
    text = (
        f"<?xml version='1.0'?><info><name>{name}</name><type>x</type>"
        f"<channel_count>{len(labels) if count is None else count}</channel_count><nominal_srate>0</nominal_srate>"
        f"<channel_format>{kind}</channel_format><created_at>1</created_at>"
        f"<desc><channels>{channels}</channels></desc></info>"
    )
    return struct.pack("<HI", 2, stream) + text.encode()


def samples(stream: int, stamps: np.ndarray, rows: np.ndarray, count: int | None = None) -> bytes:
    """A chunk of samples, (n, channels); ``count`` of them, where it claims to hold another number."""
    body = b"".join(struct.pack("<Bd", 8, t) + row.tobytes() for t, row in zip(stamps, rows, strict=True))
    return struct.pack("<HIBQ", 3, stream, 8, len(stamps) if count is None else count) + body


def clock(stream: int, t_s: float, offset_s: float) -> bytes:
    """A comparison of a stream's clock with the recorder's."""
    return struct.pack("<HIdd", 4, stream, t_s, offset_s)


def xdf(streams: dict[str, tuple[list[str], np.ndarray, np.ndarray]]) -> bytes:
    """name → (labels, stamps, (n, channels)) as a file."""
    chunks = [struct.pack("<H", 1) + b"<?xml version='1.0'?><info><version>1.0</version></info>"]
    for number, (name, (labels, stamps, rows)) in enumerate(streams.items(), 1):
        chunks += [head(number, name, labels), samples(number, stamps, rows)]
        chunks.append(struct.pack("<HI", 6, number) + b"<?xml version='1.0'?><info></info>")
    return xdf_file(chunks)
