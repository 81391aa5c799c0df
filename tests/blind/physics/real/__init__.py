"""Hands, beams and rigs as laboratories have them.

Written from published properties of hands (ellipses, the two-thirds power law, physiological tremor) and of sensors (a
Gaussian beam, a comparator with hysteresis, a response time).
"""
