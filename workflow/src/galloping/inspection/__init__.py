"""What a recording is worth before anything is identified."""
