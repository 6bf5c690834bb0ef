"""One head's order: what it costs, and moves that change it."""
