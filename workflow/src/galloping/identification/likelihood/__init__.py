"""Identification by maximum likelihood: weak form, trajectory fits, and assessment of the result.

Comments that say "measured" refer to fits to random lines (`galloping.trials.recorded_lines`) and
to spans (`galloping.trials.real_lines`), of seeds whose results are reported nowhere; effects of
other constants are in docs/identification_parts.csv. A period is the shortest of the motion; cubic
terms of a line cause harmonics up to the third.
"""
