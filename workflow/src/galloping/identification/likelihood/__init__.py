"""Identification at the physical limit: weak form, maximum likelihood, and verdicts.

What a comment calls measured was measured on fits to random lines
(`galloping.trials.recorded_lines`) and to spans (`galloping.trials.real_lines`), of seeds whose
results are reported nowhere; what other constants are worth is in docs/identification_parts.csv. A
period is the shortest of the motion; cubic terms of a line make harmonics up to its third.
"""
