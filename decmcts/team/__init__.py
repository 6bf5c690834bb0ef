"""Several heads: joint plans, schedules and Dec-MCTS (no input or output here)."""
