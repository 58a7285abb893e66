"""Galloping of iced overhead lines: derive, simulate, measure, identify, evaluate."""
