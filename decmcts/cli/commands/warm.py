"""`decmcts warm`: everything compiled ahead, by two processes, with progress."""

from __future__ import annotations

import typer

from decmcts.cli.console import err, out, steps
from decmcts.cli.options import app
from decmcts.jit.store import cache_home, remove_unused
from decmcts.planning.compiling import all_parts, cache_line, is_compiled, made
from decmcts.planning.events import Step


@app.command()
def warm() -> None:
    """Compile everything ahead of need; takes minutes once, and nothing when it is done."""
    parts = all_parts()
    missing = [part for part in parts if not is_compiled(part)]
    for folder in remove_unused(cache_home()):
        err.show(f"removed {folder}, unused for 30 days")
    with steps() as report:
        done = len(parts) - len(missing)
        if missing:
            report(Step(f"compiling: {done} of {len(parts)} parts are done"))
        for part in made(missing):
            done += 1
            report(Step(f"compiling: {done} of {len(parts)} parts are done, last: {part}"))
    left = [part for part in parts if not is_compiled(part)]
    if left:
        err.show(f"not compiled, or not kept: {', '.join(left)}")
        raise typer.Exit(1)
    out.show(cache_line())
