"""Configuration of a study: its settings, their checks, and the reference generated from them."""
