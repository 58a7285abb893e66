"""Systems under random forces, modelled as stochastic differential equations."""
