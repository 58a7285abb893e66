"""Quality of a recording before any identification."""
