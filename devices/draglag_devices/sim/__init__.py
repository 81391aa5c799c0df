"""The simulated rig and its sources."""
