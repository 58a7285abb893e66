"""Independent trials of what the identification claims of its models."""
