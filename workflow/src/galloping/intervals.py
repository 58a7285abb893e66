"""What the intervals of tables and figures hold: of replicates 90 %, of an estimate 95 %."""

QUANTILES_90 = (0.05, 0.95)
QUANTILES_95 = (0.025, 0.975)
NORMAL_95 = 1.959963984540054  # half width in standard deviations
