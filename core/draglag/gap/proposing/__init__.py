"""Refits with one more effect."""
