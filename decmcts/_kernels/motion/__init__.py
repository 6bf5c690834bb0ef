"""Time of moves, as a firmware plans them."""
