"""What is known of the files of each slicer: one `Dialect` a file, and nothing elsewhere."""
