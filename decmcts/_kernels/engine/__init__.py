"""Several heads' plans carried out: who waits, steps aside and begins when."""
