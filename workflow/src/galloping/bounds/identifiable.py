"""When a term counts as identifiable."""

# |c| / bound from which a selection with penalty 2 ln N can be trusted.
IDENTIFIABLE = 7.6
