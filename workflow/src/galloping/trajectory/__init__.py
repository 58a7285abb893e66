"""Motion of a model, with and without inputs, by power series."""
