"""A sequence, whole or in blocks, annealed on threads and put together."""
