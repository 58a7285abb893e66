"""Properties of an identified model: small motions, limit cycles, onset, forecasts."""
