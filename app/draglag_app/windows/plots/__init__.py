"""Plots: one frame and one kind of plot for all pages, and what it hands out."""
