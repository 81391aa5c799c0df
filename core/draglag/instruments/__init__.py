"""Device clocks, the beam, touchscreen calibration and orientation, taps."""
