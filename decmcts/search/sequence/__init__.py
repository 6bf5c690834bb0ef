"""What every search shares: the problem, the best order so far, greedy orders, when to stop."""
