"""What a controller does with the lines: moves, sticky state, limits and time."""
