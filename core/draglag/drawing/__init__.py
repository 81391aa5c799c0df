"""Results on matplotlib axes, in one style."""
