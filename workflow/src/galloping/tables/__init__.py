"""Tables of the study, from scores to claims."""
