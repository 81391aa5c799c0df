"""Shrink: the fitted model in the forward simulation, the session simulated again, and the model as a file."""
