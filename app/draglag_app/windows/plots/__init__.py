"""Plots of all pages."""
