"""Planners for several heads that others would use, to compare with: `planners.BASELINES`."""
