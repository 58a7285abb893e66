"""The report: one self-contained page with what was found, every figure and every table."""
