"""The report of a plan: one self-contained HTML page, no network needed."""
