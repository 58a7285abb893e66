"""Inference of numbers that the paper does not print, from noise realisations of its study."""
