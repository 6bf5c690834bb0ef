"""Files as text, and text as lines: plain, gzipped or packed G-code."""
