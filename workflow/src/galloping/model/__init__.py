"""Models: equations in states and inputs, how libraries are written, modes of small motions."""
