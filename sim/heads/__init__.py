"""Several heads' files, read back together."""
