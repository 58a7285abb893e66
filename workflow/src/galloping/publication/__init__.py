"""A finished study as an archive: made, verified, restored."""
