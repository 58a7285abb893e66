"""From recordings to where a search for a model starts: faults, smooth curves, rate channels, and
the weak form on the curves.
"""
