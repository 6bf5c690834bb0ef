"""Ready-to-run examples and the prints they use."""
