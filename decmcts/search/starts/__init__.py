"""Orders to begin with."""
