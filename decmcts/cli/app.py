"""The program commands register on, and the options of every command."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from decmcts.version import __version__

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Finds a better, proven-safe order for the extrusions of a 3D print.",
)


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"decmcts {__version__}")
        raise typer.Exit


@app.callback()
def options(
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True)
    ] = False,
) -> None:
    """Options of every command."""
    if debug:
        os.environ["DECMCTS_DEBUG"] = "1"
