"""Identification at the physical limit: bounds, weak form, maximum likelihood, and verdicts."""
