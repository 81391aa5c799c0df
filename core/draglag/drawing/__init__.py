"""Results on matplotlib axes, in one style; knows the results by their types alone."""
