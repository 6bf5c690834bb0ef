"""How bytes get to peers, and who is there: zenoh, a network in memory, or none."""
