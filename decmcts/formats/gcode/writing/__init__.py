"""G-code of a planned order, for one head or several."""
