"""The planner that puts everything together, phase by phase."""
