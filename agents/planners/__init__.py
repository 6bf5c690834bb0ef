"""What is computed for an agent: the problem it is given, and the planner behind it."""
