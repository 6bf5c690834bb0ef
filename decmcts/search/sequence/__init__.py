"""What every search shares: the problem, the best order so far, when to stop, annealing."""
