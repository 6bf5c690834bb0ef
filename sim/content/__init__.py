"""What is printed: contours, their paths and entries."""
