"""Judges: motion, collision, replay, verification, reports and experiments."""
