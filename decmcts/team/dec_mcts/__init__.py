"""Each head's search: trees, distributions, and the best joint order refined."""
