"""Measurements by hands, panels and beams as laboratories have them, to judge what an estimate's interval covers.

The hand, the beam and the laws are those of tests/blind/physics; shares no code with the library that is judged.
"""
