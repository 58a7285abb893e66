"""Recordings, their inputs, and how a trajectory is measured."""
