"""Edges and traces of a session: where the stylus was, and how it moved, when the beam was crossed."""
