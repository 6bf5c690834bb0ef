"""Run the command line as `python -m decmcts.cli`."""

from decmcts.cli import main

main()
