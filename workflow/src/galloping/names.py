"""Names that settings, tables and figures share."""

# kinds of cells, with which their names begin
NOISE = "noise"  # a whole record
SUBSET = "points"  # random samples of it
JOINT = "joint"  # all recordings of a case together

BOUND = "bound"  # the Cramer-Rao bound, where methods are named
# what the paper did, as its printed numbers tell: see `galloping.paper`
PAPER_PROTOCOL, PAPER_METHOD = "derivative", "paper"
OURS = "maximum_likelihood"  # what figures set beside the paper's method
OURS_FAMILY = "likelihood"
