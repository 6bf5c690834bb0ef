"""One head: planners over linear extensions of the dependency graph."""
