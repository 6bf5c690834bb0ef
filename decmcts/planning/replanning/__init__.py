"""A print that was broken off: what is left of it, and who prints it."""
