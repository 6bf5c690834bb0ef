"""The process of one head while it prints: `python -m agents.runner`, started by `decmcts run`.

It speaks to its controller through two pipes (`agents.running.port`), to the other heads over
zenoh, and to its launcher in JSON lines. Commands of the launcher: `plan`, `hold`, `limit`,
`fence`, `pause`, `resume`, `exit`. What it says: `ready`, `pulse`, `stands` (where it is,
whom it waits for, whom it does not hear), `held`, `controller` (it is gone), `refused`. SIGUSR2
takes it off the network, for trials.
"""

from __future__ import annotations

import argparse
import math
import os
import queue
import signal
import threading
import time
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

from agents.launching.places import remove_left
from agents.launching.processes import failed
from agents.loop.pipes import PipeFront, any_command
from agents.networks.memory import LossyTransport, Weather
from agents.networks.transport import NoNetwork, Packet, Transport
from agents.networks.zenoh_transport import ZenohTransport
from agents.running.carrier import Carrier, NumberedPlan
from agents.running.clock import PrintClock
from agents.running.port import ALIVE_S, SILENT_S, Pipe, Ready, ReleaseActions, pack, write_all
from agents.running.report import KIND, Reached, unpack_report
from decmcts.formats.plans.plan_json import read_plan
from decmcts.leaving import leave

POLL_S = 0.002
AHEAD_S = 5.0  # nominal seconds released ahead,
AHEAD_PACE_S = 0.1  # and seconds of the world, where a print goes faster


def digest_of(path: str) -> str:
    """Return the digest of a plan's file."""
    return blake2b(Path(path).read_bytes(), digest_size=16).hexdigest()


class Runner:
    """One head's agent: its carrier, and everything that carries words to and from it."""

    def __init__(self, given: argparse.Namespace, front: PipeFront, transport: Transport) -> None:
        self.front, self.transport = front, transport
        self.clock = PrintClock(given.clock)
        # An agent that takes another's place tells more than that one did.
        self.carrier = Carrier(given.head, seq=time.time_ns() // 1_000_000)
        self.to, self.controller = given.to, Pipe(given.of)
        os.set_blocking(given.of, False)
        self.received_at = math.inf  # the controller; it has not stated anything yet
        self.peers_at: dict[int, float] = {}
        self.wrote_at = self.reported_at = self.stood_at = -float("inf")
        self.last: tuple[Any, ...] = ()
        self.stood: dict[str, Any] = {}
        self.cut = False
        self.gone = False  # the controller
        self.loaded: queue.SimpleQueue[tuple[int, NumberedPlan]] = queue.SimpleQueue()
        self.limits = 0  # so many were stated: plans announced before the last are void

    def run(self) -> None:
        """Work until the launcher ends it."""
        while True:
            for command in self.front.commands():
                if not isinstance(command, dict) or command.get("command") == "exit":
                    return
                self._obey(command)
            while not self.loaded.empty():
                limits, plan = self.loaded.get()
                if limits == self.limits:
                    self.carrier.take_plan(plan)
            if self.cut and not isinstance(self.transport, NoNetwork):
                self.transport.__exit__()
                self.transport = NoNetwork()
            self._receive()
            self._speak()

    def _obey(self, command: dict[str, Any]) -> None:
        carrier = self.carrier
        match command:
            case {"command": "plan", "number": number, "path": path, "heads": heads}:
                # Large plans take seconds, in which others must hear of us.
                args = (self.limits, number, path, tuple(heads))
                threading.Thread(target=self._load, args=args, daemon=True).start()
            case {"command": "hold", "count": count}:
                carrier.hold()
                self._speak()
                number, released = carrier.holds
                self.front.write(
                    {"event": "held", "count": count, "number": number, "released": released}
                )
            case {"command": "limit", "number": number, "until": until}:
                self.limits += 1
                carrier.take_limit(number, until)
            case {"command": "fence", "head": head, "number": number, "reached": reached}:
                carrier.fence(head, number, Reached(*reached))
            case {"command": "pause"}:
                carrier.pause()
            case {"command": "resume"}:
                carrier.resume()

    def _load(self, limits: int, number: int, path: str, heads: tuple[int, ...]) -> None:
        digest, plan = digest_of(path), read_plan(path).plan
        self.loaded.put((limits, NumberedPlan(number, path, digest, plan, heads)))

    def _receive(self) -> None:
        now = time.monotonic()
        for stated in self.controller.statements():
            self.received_at = now
            if isinstance(stated, Ready):
                plan = self.carrier.plans.get(stated.number)
                if plan is not None and stated.digest != plan.digest:
                    self.front.write({"event": "refused", "number": stated.number})
                    continue
            self.carrier.take_statement(stated)
        for arrival in self.transport.receive(POLL_S):
            if isinstance(arrival, Packet) and arrival.kind == KIND:
                try:
                    self.carrier.take_report(unpack_report(arrival.head, arrival.payload))
                    self.peers_at[arrival.head] = time.monotonic()
                except ValueError:
                    continue  # a peer's bad message is dropped
        if self.carrier.is_starting and self.controller.open:  # a large plan takes it seconds
            self.received_at = max(self.received_at, now - SILENT_S + ALIVE_S)
        silent = not self.controller.open or now - self.received_at > SILENT_S
        if silent and not self.gone and not self.carrier.off:
            self.gone = True
            how = "hangs" if self.controller.open else "ended"
            self.front.write({"event": "controller", "how": how})

    def _speak(self) -> None:
        now, carrier = time.monotonic(), self.carrier
        carrier.ahead_s = max(AHEAD_S, AHEAD_PACE_S * self.clock.pace)
        commands = carrier.step(self.clock.now())
        asked = b"".join(map(pack, commands))
        state = (carrier.number, carrier.held, carrier.reached, carrier.off, carrier.released)
        changed = state != self.last
        asks = any(not isinstance(command, ReleaseActions) for command in commands)
        if changed or asks or now - self.wrote_at >= ALIVE_S:
            self.wrote_at = now
            write_all(self.to, asked)
        if changed or now - self.reported_at >= ALIVE_S:
            self.reported_at, self.last = now, state
            self.transport.send(KIND, carrier.report().pack(), reliable=False)
        if now - self.stood_at >= ALIVE_S:
            self._report_stand(now)

    def _report_stand(self, now: float) -> None:
        carrier = self.carrier
        plan = carrier.plans.get(carrier.number)
        peers = [head for head in (() if plan is None else plan.heads) if head != carrier.head]
        missing = [
            head for head in peers
            if head not in carrier.fenced
            and now - self.peers_at.setdefault(head, now) > SILENT_S
        ]  # fmt: skip
        stands = {
            "event": "stands", "number": carrier.number, "done": carrier.done,
            "waits_for": carrier.waits_for(), "off": carrier.off,
            "missing": missing,
        }  # fmt: skip
        self.stood_at = now
        if stands != self.stood:
            self.stood = stands
            self.front.write(stands)


def arguments() -> argparse.ArgumentParser:
    """Return the parser of what the launcher hands over."""
    parser = argparse.ArgumentParser(prog="decmcts run-time agent")
    parser.add_argument("--head", type=int, required=True)
    parser.add_argument("--epoch", type=int, required=True)
    parser.add_argument("--clock", type=Path, required=True)
    parser.add_argument("--to", type=int, required=True, help="descriptor that is written")
    parser.add_argument("--of", type=int, required=True, help="and read")
    parser.add_argument("--loss", type=float, default=0.0)
    parser.add_argument("--delay", type=float, default=0.0, help="seconds, at most")
    parser.add_argument("--seed", type=int, default=0)
    return parser


def main() -> int:
    """Run one agent; return its exit code."""
    front = PipeFront(parse=any_command)
    front.sweep = lambda: remove_left(front.meeting)
    front.watch()
    front.beat()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        words = front.arguments()
        if words is None:
            return 0
        given = arguments().parse_args(words)
        with _transport(given, front) as transport:
            runner = Runner(given, front, transport)

            def cut(*_: Any) -> None:
                runner.cut = True

            signal.signal(signal.SIGUSR2, cut)
            front.ready("")
            runner.run()
            runner.transport = NoNetwork()
    except Exception as error:
        return failed(error)
    return 0


def _transport(given: argparse.Namespace, front: PipeFront) -> Transport:
    if front.meeting is None:
        return NoNetwork()
    bus = ZenohTransport(
        front.meeting.seal, given.head, given.epoch, front.meeting.places, on_shut=front.shut,
        kinds=(KIND,),
    )  # fmt: skip
    if given.loss == 0.0 and given.delay == 0.0:
        return bus
    weather = Weather(loss=given.loss, delay_s=(0.0, given.delay), duplicate=0.1)
    return LossyTransport(bus, weather, np.random.default_rng([given.seed, given.head]))


if __name__ == "__main__":
    leave(main())
