"""The written file, read back."""
