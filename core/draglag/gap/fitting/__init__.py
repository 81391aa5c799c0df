"""The joint fit of curve, beam and named effects, with noise estimated from the session."""
