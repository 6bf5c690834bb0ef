"""What experiments are made of: prints made by code, teams in memory, plans run by a clock."""
