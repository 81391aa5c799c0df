"""Edges and traces: where the stylus was, and how it moved, at each crossing."""
