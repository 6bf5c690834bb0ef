"""The command line: the composition root, the only place that may import everything.

`app` declares the commands; `pipeline` runs one print from file to checked plan;
`outputs` writes what was asked for; `console` shows progress and tables.
"""

from decmcts.cli.app import app, main

__all__ = ["app", "main"]
