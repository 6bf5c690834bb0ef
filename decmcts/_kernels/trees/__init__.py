"""Trees and beams over orders, and greedy starts."""
