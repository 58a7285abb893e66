"""Study cells: their settings, and the files of their results."""
