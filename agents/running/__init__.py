"""A plan carried out: what the agent of each head does while it prints."""
