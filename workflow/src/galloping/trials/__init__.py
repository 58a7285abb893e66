"""Trials of the methods where no study has a true model to compare coefficients with."""
