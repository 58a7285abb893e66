"""Sparse regression on a candidate library, with pysindy's optimizers."""
