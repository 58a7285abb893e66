"""Report: one self-contained page with the results, every figure and every table."""
