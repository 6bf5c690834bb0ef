"""Heads and material in space and time: who touches what."""
