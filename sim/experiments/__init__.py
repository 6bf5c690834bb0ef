"""What benchmarks and tests do to plans: spoil them, delay heads, kill agents."""
