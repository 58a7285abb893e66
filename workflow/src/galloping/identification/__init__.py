"""From a recording to a sparse model: candidate methods behind one interface."""
