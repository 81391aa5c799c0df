"""Edges and traces."""
