"""Measurements by hands, panels and beams as laboratories have them, to judge what an estimate's interval covers.

Written from published properties of hands (ellipses, the two-thirds power law, physiological tremor) and of sensors (a
Gaussian beam, a comparator with hysteresis, a response time); shares no code with the library that is judged.
"""
