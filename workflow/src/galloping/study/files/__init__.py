"""Every kind of file of a study: one module each, which alone knows what is in it."""
