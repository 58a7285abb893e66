"""What the paper leaves out, inferred from what it prints: draws of its study at any setting."""
