"""Systems that random forces move: models as stochastic differential equations."""
