"""The simulated rig: hand, stylus, digitiser, beam, sensor, clocks; and its sources."""
