"""The simulated rig: one world of hand, stylus, digitiser, beam, sensor and clocks, and the sources that see it."""
