"""The Qt windows: the participant's display and the operator's station."""
