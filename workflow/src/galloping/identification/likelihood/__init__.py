"""Identification at the physical limit: weak form, maximum likelihood, and verdicts.

Of a constant, "measured" means on fits to random lines (`galloping.trials.recorded_lines`) and to
spans (`galloping.trials.real_lines`) of seeds that report nothing. A period is the shortest of the
motion; the cubic terms of a line make harmonics up to its third.
"""
