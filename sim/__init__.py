"""The judge, and the reports, pictures and experiments beside it."""
