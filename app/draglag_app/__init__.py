"""Acquisition, command line and windows."""
