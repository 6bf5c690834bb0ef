"""Several heads, each its own process: what they agree on becomes one exact plan."""
