"""A sequence in parts: cut into blocks, contracted, annealed on threads, put together."""
