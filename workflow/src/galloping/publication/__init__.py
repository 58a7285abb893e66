"""Archive of a finished study: made, verified, restored."""
