"""The tables of the study, from scores to claims."""
