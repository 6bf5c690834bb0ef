"""A plan carried out by agents and controllers, and planned anew where heads fail."""
