"""Identification of a sparse model from recordings: all methods, with one interface."""
