"""Sparse regression on a candidate library, with pysindy's smoothing, weak form and optimizers."""
