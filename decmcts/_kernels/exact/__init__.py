"""Best orders and directions of few contours, and bounds of many."""
