"""What a plan prints: contours, their paths and entries."""
