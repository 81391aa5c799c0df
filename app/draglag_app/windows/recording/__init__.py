"""A recording under way as the window has it: its thread, its signals, what is drawn and estimated meanwhile."""
