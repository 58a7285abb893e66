"""Sparse identification: from a recording to a polynomial model."""
