"""The operator's and the participant's windows, in Qt."""
