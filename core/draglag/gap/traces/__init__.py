"""Edges and traces of a session, ready for the fit: where the stylus was, and how it moved, when the beam said so."""
