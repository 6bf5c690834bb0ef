"""Experiments that come with the program: from a question to rows, a table and a figure."""
