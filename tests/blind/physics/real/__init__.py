"""Realistic hands, beams and rigs, from published properties of hands (ellipses, the two-thirds power law,
physiological tremor) and sensors (a Gaussian beam, a comparator with hysteresis, a response time)."""
