"""What a print is: contours, toolpaths, machines and plans, all frozen data."""
