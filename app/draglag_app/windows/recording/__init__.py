"""A recording in progress: its thread, signals, plots and estimates."""
