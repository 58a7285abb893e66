"""The line, its wind and its sensors: equations of motion from parameters."""
