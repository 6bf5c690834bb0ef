"""From all heads' plans to one joint order, the same on every host."""
