"""Equilibria and limit cycles of polynomial models along a parameter."""
