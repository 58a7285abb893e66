"""Tables of two runs, compared: with the reference, or with those of an archive."""
