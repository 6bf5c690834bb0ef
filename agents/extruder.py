"""The process of one head: `python -m agents.extruder INPUT --head N --addresses A,B --secret F`.

Loads the problem, opens the network, steps the agent until it is told to go or
everyone has settled. With `--piped` alone it loads its modules and kernels and is then
handed its command line on stdin. Signals: SIGINT agrees on the best so far, SIGTERM leaves.
A failure is one line on stderr and exit code 1 (2: bad input); `--debug` shows
the trace.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from agents.agreeing.events import Leave, PlanningEnded, PlanReleased
from agents.launching.places import remove_left
from agents.launching.processes import PIPED, failed
from agents.loop.agent import TICK_S, Agent, FrontEnd
from agents.loop.pipes import PipeFront, TerminalFront, line_of
from agents.messages.kinds import MAX_SILENCE_TICKS, SILENCE_TICKS, apart
from agents.networks.meeting import Meeting, addresses, secret_of
from agents.networks.transport import NoNetwork, Traffic, Transport
from decmcts.errors import InputError
from decmcts.formats.files.atomic import write_whole
from decmcts.leaving import leave

if TYPE_CHECKING:
    from agents.planners.team_planner import DecMctsPlanner

LINGER_S = 10.0  # an agent without a launcher answers stragglers so long after its release
WAIT_S = 60.0  # an agent without a launcher begins to plan after so long although heads are missing


MakePlanner = Callable[[argparse.Namespace], "DecMctsPlanner"]


def run(
    planner: DecMctsPlanner, given: argparse.Namespace, pipe: PipeFront | None = None
) -> PlanReleased | None:
    """Run one head's agent, `given` as by `options_of`, to its end; return the plan it released.

    InputError if it is alone, without a launcher, and cannot print everything: nobody helps.
    """
    if given.meeting is None and not given.controlled:
        planner.serial((given.head,))
    front: FrontEnd = (pipe or PipeFront()) if given.controlled else TerminalFront()
    signal.signal(signal.SIGINT, lambda *_: front.ask(PlanningEnded()))
    signal.signal(signal.SIGTERM, lambda *_: front.ask(Leave("terminated")))
    others = tuple(head for head in range(len(planner.names)) if head != given.head)
    traffic = Traffic()
    with _transport(given, traffic, pipe) as transport:
        agent = Agent(
            given.head,
            given.epoch,
            planner=planner,
            transport=transport,
            front=front,
            time_limit_s=given.time_limit,
            clock=time.monotonic,
            wait_s=math.inf if given.controlled else WAIT_S,  # a launcher gives up heads itself
            fenced=others if given.meeting is None else given.fenced,
            silence_s=given.silence,
            traffic=traffic,
        )
        front.ready(planner.problem)
        _step_to_the_end(agent, linger_s=None if given.controlled else LINGER_S)
    if given.output is not None and agent.released is not None:
        write_whole(given.output, json.dumps(line_of(agent.released)).encode())
    return agent.released


def _step_to_the_end(agent: Agent, *, linger_s: float | None) -> None:
    ends = float("inf")
    while not agent.done:
        agent.step()
        if linger_s is not None and agent.released is not None:
            ends = min(ends, time.monotonic() + linger_s)
            if agent.protocol.settled or time.monotonic() >= ends:
                agent.leave("done")


def _transport(given: argparse.Namespace, traffic: Traffic, pipe: PipeFront | None) -> Transport:
    meeting: Meeting | None = given.meeting
    if meeting is None:
        return NoNetwork()
    if not 0 <= given.head < len(meeting.places):
        raise InputError(f"--head {given.head}, but {len(meeting.places)} places to meet")
    # Imported here: the single-extruder mode needs no zenoh.
    from agents.networks.zenoh_transport import ZenohTransport

    return ZenohTransport(
        meeting.seal,
        given.head,
        given.epoch,
        meeting.places,
        on_drop=lambda reason: traffic.dropped.update([reason]),
        on_shut=None if pipe is None else pipe.shut,
    )


def numbers(text: str) -> tuple[int, ...]:
    """Return the whole numbers of a list with commas."""
    return tuple(int(part) for part in text.split(",") if part)


class _Parser(argparse.ArgumentParser):
    """Says in one line what is wrong, as the rest of the program does."""

    def error(self, message: str) -> NoReturn:
        raise InputError(message, advice="--help lists what an agent takes")


def arguments() -> argparse.ArgumentParser:
    """Return the parser of an agent's command line; it raises `InputError`."""
    parser = _Parser(
        prog="decmcts agent",
        description="One head's agent.",
        epilog=f"{PIPED} alone: load first, and take all this from stdin (docs/protocol.md).",
    )
    parser.add_argument("source", type=Path, nargs="?", help="G-code to plan")
    parser.add_argument("--machine", default="dual-gantry", help="preset or file")
    parser.add_argument("--process-order", choices=("keep", "free"), default="keep")
    parser.add_argument("--no-quality", action="store_true", help="shells in any order")
    parser.add_argument("--pack", type=Path, help="folder with the problem, instead of a source")
    parser.add_argument("--expect", default="", help="digest the problem must have")
    parser.add_argument("--head", type=int, required=True, help="index of this head")
    parser.add_argument(
        "--addresses",
        type=addresses,
        default=(),
        help="HOST:PORT of every head, or a PORT of this host; none: alone",
    )
    parser.add_argument("--secret", type=Path, help="file with the secret all agents share")
    parser.add_argument("--epoch", type=int, default=0, help="incarnation; default: now")
    parser.add_argument("--fenced", type=numbers, default=(), help="heads that are off")
    parser.add_argument("--time-limit", type=float, default=30.0, help="seconds of planning")
    parser.add_argument(
        "--silence",
        type=float,
        default=SILENCE_TICKS * TICK_S,
        help="seconds till it counts as stuck",
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--controlled", action="store_true", help="obey a launcher on stdin")
    parser.add_argument("--output", type=Path, help="write the released plan here, as JSON")
    parser.add_argument("--debug", action="store_true", help="show traces")
    return parser


def options_of(given: argparse.Namespace, meeting: Meeting | None = None) -> argparse.Namespace:
    """Check what a command line asks for and add where to meet; raises `InputError`.

    A launcher hands over the `meeting`; by hand its places are arguments and its secret a file.
    Without either the agent is alone.
    """
    longest_s = MAX_SILENCE_TICKS * TICK_S
    if not 1.0 <= given.silence <= longest_s:
        raise InputError(f"--silence {given.silence:g}, allowed 1..{longest_s:g} seconds")
    if not 0.0 <= given.time_limit < math.inf:
        raise InputError(f"--time-limit {given.time_limit:g}, must be at least 0 and finite")
    if meeting is None and given.addresses:
        if given.secret is None:
            raise InputError(
                "--addresses without --secret: anybody could join",
                advice="name a file with a secret that all agents share (docs/protocol.md)",
            )
        meeting = Meeting(given.addresses, secret_of(given.secret))
    given.meeting = meeting
    given.epoch = given.epoch or time.time_ns() // 1_000_000
    return given


def _team_planner(given: argparse.Namespace) -> DecMctsPlanner:
    # Imported here: the computing rooms take a second to load, which tests of
    # the processes with a planner of their own need not wait for.
    from agents.planners.pack import load_source, read_pack
    from agents.planners.team_planner import DecMctsPlanner

    if given.pack is not None:
        pack = read_pack(given.pack)
    elif given.source is not None:
        pack = load_source(
            given.source, given.machine, given.process_order, quality=not given.no_quality
        )
    else:
        raise InputError("no print given", advice="name a file, or a folder with --pack")
    if not 0 <= given.head < len(pack.machine.heads):
        last = len(pack.machine.heads) - 1
        raise InputError(f"--head {given.head}, but {pack.machine.name} has heads 0..{last}")
    return DecMctsPlanner.of_pack(pack, given.head, seed=given.seed)


def load_team() -> None:
    """Load what planning needs of modules and kernels, before there is a print."""
    from agents.planners import pack, team_planner  # noqa: F401 - loaded here, used later
    from decmcts.team.dec_mcts.warm_up import compile_rounds

    compile_rounds()


def main(
    argv: Sequence[str] | None = None,
    *,
    make_planner: MakePlanner = _team_planner,
    load: Callable[[], None] = load_team,
) -> int:
    """Run one agent; return its exit code."""
    words = sys.argv[1:] if argv is None else argv
    if list(words) != [PIPED]:
        return _run_with(words, make_planner)
    pipe = PipeFront()
    pipe.sweep = lambda: remove_left(pipe.meeting)
    pipe.watch()
    pipe.beat()
    try:
        load()
        handed = pipe.arguments()
    except Exception as error:
        return failed(error)
    code = 0 if handed is None else _run_with(handed, make_planner, pipe)
    pipe.sweep()
    return code


def _run_with(
    words: Sequence[str], make_planner: MakePlanner, pipe: PipeFront | None = None
) -> int:
    given = None
    try:
        given = arguments().parse_args(words)
        options_of(given, None if pipe is None else pipe.meeting)
        planner = make_planner(given)
        if given.expect and planner.problem != given.expect:
            ours, theirs = apart(planner.problem, given.expect)
            raise InputError(
                f"the problem has digest {ours}, the launcher's has {theirs}",
                advice="both sides need the same version of decmcts",
            )
        run(planner, given, pipe)
    except Exception as error:
        if given is not None and given.debug and not isinstance(error, InputError):
            raise
        return failed(error)
    return 0


if __name__ == "__main__":
    leave(main())
