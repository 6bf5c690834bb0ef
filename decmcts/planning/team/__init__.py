"""Several heads, one process each, and the exact plan made of what they agree on."""
