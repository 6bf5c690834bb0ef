"""A sequence, whole or in blocks and contracted runs, annealed on threads and put together."""
