"""Run the command line as `python -m decmcts.cli`."""

from decmcts.cli.app import main

main()
