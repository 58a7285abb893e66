"""Recordings from the field: from files of an instrument to recordings of states."""
