"""Errors of models against the truth: identified ones, and the two-mode model of a line."""
