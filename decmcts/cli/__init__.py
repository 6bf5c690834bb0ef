"""The command line: arguments, what a person sees, and how a run is stopped.

`commands` has one module a command, `options` what several share; `run` turns every failure
into one line. `console` shows what `decmcts.planning` reports, on `streams` that never fail;
`lines` say how it went; `signals` stop it.
"""

from __future__ import annotations

import gc
import sys

from decmcts.cli import signals, streams
from decmcts.leaving import leave

__all__ = ["main"]


def main() -> None:
    """Run the command line; every failure is one line on standard error."""
    streams.forgive()
    signals.end_on_signals()
    gc.disable()  # imports make no garbage, and looking for it takes a seventh of the start
    try:
        from decmcts.cli.run import run  # takes a second: Ctrl-C may come in it

        gc.freeze()  # later collections leave out what the modules made
        gc.enable()
        code = run(sys.argv[1:])
    except KeyboardInterrupt:  # here, or while commands are still being built
        sys.stderr.write("decmcts: stopped; nothing was written\n")
        code = signals.exit_code()
    signals.ignore_signals()  # what is done is done: nothing changes the exit code any more
    gc.freeze()  # at exit there is nothing to look through: half a second saved
    leave(code)
