"""Device clocks, the beam's two lines, calibration and orientation of the touchscreen, taps."""
