"""The fitted model in simulation, and as a file."""
