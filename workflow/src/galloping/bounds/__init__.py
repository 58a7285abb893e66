"""How precisely any unbiased method can know each coefficient."""
