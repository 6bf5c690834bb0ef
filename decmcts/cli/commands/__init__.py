"""The commands; importing this registers each on `app`, in the order `--help` lists them."""

# ruff: noqa: F401, I001  # imported for that, in that order
from decmcts.cli.commands import verify, simulate, machines, plan, post
from decmcts.cli.commands import launch, run, replan, warm, experiment
