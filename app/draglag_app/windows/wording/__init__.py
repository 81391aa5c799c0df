"""What the operator reads: names, numbers and sentences, in the language of the settings."""
