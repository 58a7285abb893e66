"""Recordings, their inputs, and simulated measurements of trajectories."""
