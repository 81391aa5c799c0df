"""Plots of all pages: frame, drawing, export."""
