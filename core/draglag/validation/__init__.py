"""The paper's tests of a curve: misalignment removed (Eq. 4), and sanity checks."""
