"""Klipper module: `SYNC_WAIT HEAD=2 COUNT=7` waits until head 2 has given seven signals.

Copy it to klippy/extras/sync_wait.py of each instance, and see sync.cfg. It counts changes of an
input for each other head. A change is never lost while G-code runs: inputs are read beside it.
Not tried on a machine. `SYNC_RESET` has it forget all signals; run it on all controllers in two
rounds before their files are started.
"""

from __future__ import annotations

from functools import partial
from typing import Any

POLL_S = 0.05


class SyncWait:
    """Counts what the other heads signal, and waits for it."""

    def __init__(self, config: Any) -> None:
        self.printer = config.get_printer()
        self.given: dict[int, int] = {}  # by the place of the head's file, from 1
        buttons = self.printer.load_object(config, "buttons")
        for option in config.get_prefix_options("pin_"):
            head = int(option.removeprefix("pin_"))
            self.given[head] = 0
            buttons.register_buttons([config.get(option)], partial(self._changed, head))
        gcode = self.printer.lookup_object("gcode")
        gcode.register_command("SYNC_WAIT", self.cmd_SYNC_WAIT)
        gcode.register_command("SYNC_FORGET", self.cmd_SYNC_FORGET)

    def _changed(self, head: int, eventtime: float, state: int) -> None:
        self.given[head] += 1

    def cmd_SYNC_FORGET(self, gcmd: Any) -> None:  # noqa: N802  # Klipper's way
        """Forget all signals."""
        self.given = dict.fromkeys(self.given, 0)

    def cmd_SYNC_WAIT(self, gcmd: Any) -> None:  # noqa: N802  # Klipper's way
        """Return when a head has given so many signals; moves above run out meanwhile."""
        head, count = gcmd.get_int("HEAD"), gcmd.get_int("COUNT", minval=1)
        if head not in self.given:
            raise gcmd.error(f"SYNC_WAIT: [sync_wait] has no pin_{head}")
        reactor = self.printer.get_reactor()
        toolhead = self.printer.lookup_object("toolhead")
        eventtime = reactor.monotonic()
        while self.given[head] < count and not self.printer.is_shutdown():
            toolhead.get_last_move_time()  # so that moves above are run to their end
            eventtime = reactor.pause(eventtime + POLL_S)


def load_config(config: Any) -> SyncWait:
    """Return the module for its section; Klipper calls this."""
    return SyncWait(config)
