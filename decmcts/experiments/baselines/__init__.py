"""Other planners for several heads, which experiments and benchmarks compare with."""
