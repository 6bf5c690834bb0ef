"""Trees and beams over orders, and how they are begun."""
