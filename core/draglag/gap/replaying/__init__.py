"""The fitted model in the forward simulation, and as a file."""
