"""Acquisition session, command line and windows."""
