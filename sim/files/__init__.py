"""The written file, read back and judged."""
