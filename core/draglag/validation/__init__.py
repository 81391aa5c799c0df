"""The paper's tests of a curve."""
