"""The Qt windows: the participant's display and the operator's station. Maths lives in the library."""
