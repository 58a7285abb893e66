"""Identification at the physical limit: weak form, maximum likelihood, and verdicts."""
