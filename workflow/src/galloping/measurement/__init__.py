"""From the motion of a line to recordings of it, under one protocol or another."""
