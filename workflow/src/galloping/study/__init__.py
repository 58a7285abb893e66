"""The cells of a study: what is computed, from which settings, and where it is kept."""
