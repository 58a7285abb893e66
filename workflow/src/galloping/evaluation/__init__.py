"""How far an identified model is from the true one; the only place where the truth is known."""
