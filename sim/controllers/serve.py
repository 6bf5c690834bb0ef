"""The simulated controller of one head as a process, behind the port of `decmcts run`.

`python -m sim.controllers.serve`, started by the launcher. Its agent speaks to it through stdin and
stdout; all it says is written to a record too, which the launcher keeps whatever becomes of the
agent. When its agent is gone or silent it ends the action it is at and is off; then another agent
may take it to its park. SIGUSR1 clogs it.
"""

from __future__ import annotations

import argparse
import os
import select
import signal
import sys
import time
from pathlib import Path

import numpy as np

from agents.messages.event_stream import pack_event
from agents.running.clock import PrintClock
from agents.running.port import (
    ABORTED,
    ALIVE_S,
    SILENT,
    SILENT_S,
    Abort,
    Alive,
    Command,
    Finish,
    Pause,
    Pipe,
    Ready,
    ReleaseActions,
    Resume,
    Start,
    pack,
    write_all,
)
from decmcts.formats.plans.plan_json import read_plan
from sim.controllers.feeding import Feeding, Work
from sim.controllers.motion import QUEUE
from sim.controllers.program import HeadProgram
from sim.controllers.timing import Error, Timing, draw

LEAST_POLL_S, MOST_POLL_S = 0.0005, 0.02


class Controller:
    """A controller and its two ends."""

    def __init__(self, given: argparse.Namespace) -> None:
        self.given = given
        self.clock = PrintClock(given.clock)
        self.agent, self.heard_at = Pipe(0), time.monotonic()
        self.feeding: Feeding | None = None
        self.number = -1
        self.paused = False
        self.clogs = False  # now
        self.aborted = False
        self.alive_at = -float("inf")

    def run(self) -> None:
        """Work until the agent is gone and the head is off, or the launcher is."""
        while True:
            self._hear()
            feeding, now_s = self.feeding, self.clock.now()
            if feeding is None:
                if not self.agent.open:
                    return
                continue
            if self.clogs and not feeding.off:
                self.clogs = False
                self._report(*map(pack_event, feeding.step(now_s)))
                self._report(pack_event(feeding.fail("clogged", now_s)))
            if not self.agent.open or time.monotonic() - self.heard_at > SILENT_S:
                feeding.end("its agent is gone" if not self.agent.open else SILENT)
            self._report(*map(pack_event, feeding.step(now_s)))
            if feeding.off and not self.agent.open:
                return
            if time.monotonic() - self.alive_at > ALIVE_S:
                self.alive_at = time.monotonic()
                self._report(pack(Alive(now_s, feeding.at(now_s))))

    def _hear(self) -> None:
        """Take what the agent asks; wait for it until something happens."""
        wait_s = MOST_POLL_S
        if self.feeding is not None:
            wait_s = min(max(self.clock.until(self.feeding.next_s()), LEAST_POLL_S), wait_s)
        if not self.agent.open:
            time.sleep(wait_s)
        elif select.select([0], [], [], wait_s)[0]:
            for command in self.agent.commands():
                self.heard_at = time.monotonic()
                self._take(command)

    def _take(self, command: Command) -> None:
        feeding, now_s = self.feeding, self.clock.now()
        match command:
            case Start(number, path, digest) if not self.aborted:
                self._start(number, Path(path))
                self.heard_at = time.monotonic()  # that took a while
                self._report(pack(Ready(number, digest)))
            case ReleaseActions(number, until) if feeding is not None and number == self.number:
                feeding.release(until, now_s)
            case Pause():
                self.paused = True
                if feeding is not None:
                    feeding.pause()
            case Resume():
                self.paused = False
                if feeding is not None:
                    feeding.resume(now_s)
            case Finish(why) if feeding is not None:
                feeding.end(why)
            case Abort(why) if feeding is not None and not self.aborted:
                self._report(*map(pack_event, feeding.step(now_s)))
                self.aborted = why == ABORTED
                if self.aborted or not feeding.off:
                    self._report(pack_event(feeding.fail(why, now_s)))

    def _start(self, number: int, path: Path) -> None:
        """Take a plan in the place of the one before."""
        given = self.given
        rng = np.random.default_rng([given.seed, given.head, number])

        def error(program: HeadProgram) -> Error:
            return draw(Timing(given.timing), program, given.error, rng)

        work = Work.of_plan(read_plan(path), given.name, given.queue, error)
        work.at(0, float("inf"))  # loads what is compiled, so that it holds nothing up later
        self.feeding, self.number = Feeding(given.head, work, self.clock.now()), number
        self.feeding.paused = self.paused

    def _report(self, *messages: bytes) -> None:
        """Tell launcher and agent; who is gone hears nothing.

        The record comes first: what other heads act upon is on it, whenever this process is killed.
        """
        if content := b"".join(messages):
            write_all(self.given.record, content)
            write_all(1, content)


def main() -> None:
    """Run one controller."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", required=True)
    parser.add_argument("--head", type=int, required=True)
    parser.add_argument("--clock", type=Path, required=True)
    parser.add_argument("--record", type=int, required=True)
    parser.add_argument("--timing", default="none")
    parser.add_argument("--error", type=float, default=0.2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--queue", type=int, default=QUEUE)
    controller = Controller(parser.parse_args())

    def clog(*_: object) -> None:
        controller.clogs = True

    signal.signal(signal.SIGUSR1, clog)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    controller.run()
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
