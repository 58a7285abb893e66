"""Identification: from recordings to models, with the physical limit of what they can tell."""
