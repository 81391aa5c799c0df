"""The participant's screen."""
