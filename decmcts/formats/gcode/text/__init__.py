"""Files as text, and text as lines: plain, gzipped or binary G-code."""
