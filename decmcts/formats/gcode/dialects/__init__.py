"""What the lines of each slicer mean: commands, roles, layers, and times it states."""
