"""Device clocks, the beam, calibration and orientation of the touchscreen, taps."""
