"""What is to be planned: a print, the machine it is for, its own order and what judges it."""
