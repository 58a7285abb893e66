"""What an identified model says of its system: small motions, limit cycles, onset, forecasts."""
