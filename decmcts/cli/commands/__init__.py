"""The commands; importing this registers each on `app`, in the order `--help` lists them."""

# ruff: noqa: I001  # that order
from decmcts.cli.commands import (
    verify,
    simulate,
    machines,
    plan,
    post,
    launch,
    run,
    replan,
    warm,
    experiment,
)

__all__ = [
    "experiment",
    "launch",
    "machines",
    "plan",
    "post",
    "replan",
    "run",
    "simulate",
    "verify",
    "warm",
]
