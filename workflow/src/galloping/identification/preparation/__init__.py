"""Preparation of recordings: faults, smooth curves, rate channels, and the weak form."""
