"""What is allowed: clearance, dependency graph, clustering, conflicts, safe travel."""
