"""Prepare recordings: faults, smooth curves, rate channels, and the weak form on the curves."""
