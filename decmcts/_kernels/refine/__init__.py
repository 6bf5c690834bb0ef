"""Joint orders of several heads made better."""
