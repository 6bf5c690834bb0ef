"""A sequence in parts: clusters, blocks and contracted runs, annealed on threads, put together."""
