"""Independent trials of the reliability of identified models."""
