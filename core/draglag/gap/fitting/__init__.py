"""The joint fit of curve, beam and named effects, under the noise that the session itself shows."""
