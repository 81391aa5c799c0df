"""Measurements by realistic hands, panels and beams, to test an estimate's coverage.

Hand, beam and laws are those of tests/blind/physics; no code is shared with the library judged.
"""
