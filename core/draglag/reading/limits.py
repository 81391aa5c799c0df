"""Limits on what is read from files."""

from __future__ import annotations

DOCUMENT_BYTES = 4_000_000
"""Bytes of a model, calibration, protocol, screen or settings file: a thousand times a few kilobytes."""

HEADER_BYTES = 16 * 2**20
"""Bytes of ``session.json`` and the protocol kept with it: logs and notes of 10 000 runs."""

TABLE_BYTES = 512 * 2**20
"""Bytes of a CSV or evemu file, unpacked: an hour at 1 kHz is 130 MB as CSV, 330 MB as evemu."""

TABLE_ROWS = 20_000_000
"""Lines of a CSV or evemu file: an hour at 1 kHz with five evemu lines a frame."""

LINE_BYTES = 10_000
"""Bytes of one line of a CSV or evemu file: 400 columns of 24 digits."""

GZIP_RATIO = 30
"""Unpacked over packed bytes. Measured columns shrink 2- to 10-fold, deflate ends at 1030."""

GZIP_FREE_BYTES = 2**20
"""Unpacked bytes below which the ratio is not checked: short files of equal lines pack tightly."""

DEPTH = 32
"""Nesting of tables and lists in JSON and TOML: draglag's own files have 6."""

KEY_PARTS = 32
"""Parts of one dotted TOML key: Python's reader takes time quadratic in them."""

WHOLE_MOST = 2**128 - 1
"""Largest whole number of a document, and largest seed: the 128 bits that numpy draws without a seed."""

RUNS = 10_000
"""Runs of one session: one a second for three hours."""

SIZE_MM = 100_000.0
"""Largest panel, radius or offset, mm: a wall of 100 m."""

SIZE_PX = 1_000_000
"""Largest panel, pixels along one side."""

TIME_S = 1e11
"""Largest stamp, s: seconds since 1970 are 1.8e9; stamps in ns are refused."""

EVENT_S = 0.5
"""Longest usual interval of touch events, s: slow panels take 0.02 s, those of 1 kHz in ms read as seconds 1 s."""

CONTACTS = 128
"""Contacts of one touchscreen at a time: the largest touch tables follow 100. Frames are compared pair by pair."""

CONTACT = 2**53
"""Largest number of a contact in a table: doubles do not distinguish larger whole numbers."""

STYLUS_MM = (0.0, 100.0)
"""Diameters of a stylus, the first excluded: wider than a hand's palm is none."""
