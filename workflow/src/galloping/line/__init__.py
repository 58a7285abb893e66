"""The line, its wind and its sensors: from parameters to equations of motion."""
