"""A head as keys and values: its shape, name and limits, or the clearances slicers state."""
