"""Names that settings, tables and figures share."""

# kinds of cells, with which their names begin
NOISE = "noise"  # a whole record
SUBSET = "points"  # random samples of it
JOINT = "joint"  # all recordings of a case together

BOUND = "bound"  # the Cramer-Rao bound, where methods are named
OURS = "maximum_likelihood"  # what figures set beside the paper's method
OURS_FAMILY = "likelihood"
# what the paper leaves open: `galloping.tables.reproduction.OPEN`
OPEN_PARAMETERS = ("wind_speed", "damping_ratio", "bundle_dimension", "initial_displacement")
