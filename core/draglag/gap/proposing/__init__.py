"""Refits with one more effect, proposed by traces, edges and columns."""
