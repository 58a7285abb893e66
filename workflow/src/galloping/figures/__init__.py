"""Figures of the study: pure functions from data to a matplotlib Figure, and a way to write it."""
