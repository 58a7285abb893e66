"""How far models are from the truth: identified ones from the line, two modes from many."""
