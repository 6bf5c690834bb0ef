"""Several heads' files, read back and judged together."""
