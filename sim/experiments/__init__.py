"""Simulated two-head printing experiments."""
