"""Launches of real processes that are disturbed at random.

    python benchmarks/disturbances.py [--runs 200] [--seed 0] [--kinds pause,forge]

Each run launches two heads over a fixed small problem (the tests' 40 jobs, 1.5 s of
planning) and disturbs it once, at a random moment from the start of the agents to the end
of planning. Kinds: `kill` (kill -9), `leave` (SIGTERM), `stop` (SIGSTOP for good),
`stop-both`; `pause` and `pause-both` (SIGSTOP, SIGCONT up to 5 s later); `forge` (another
process of the same user: connects to all sockets it finds, forges, floods), `inside` (one
that even has the password of the links, but not the key of the seals), `stranger` (another user
of the host, where this may be tried), `unlink` (the sockets are removed, half of the time while
a head is stopped), `folder` (their whole folder is, likewise), `taken` (somebody listens at
the port of a head).

A fault is: a joint plan lost though both heads live, or no valid plan; a run that takes
longer than its limit and 15 s from when the agents are ready; a process or a file left.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from common import RESULTS, ROOT, Rows, grouped, markdown, run_missing, setting

from agents.launching.places import Places
from agents.launching.spawn import Agreement, run_agents
from agents.launching.status import AgentStatus, LaunchError
from agents.networks.meeting import UNIX, Meeting
from agents.networks.transport import DISTURBS
from decmcts.search.sequence.stopping import Stopping
from tests.agents.toy import load_balance

KEY = ("seed", "kind")
TOY = (sys.executable, str(ROOT / "tests" / "integration" / "toy_agent.py"))
LIMIT_S, EXTRA_S, JOBS = 1.5, 15.0, 40
KINDS = ("kill", "leave", "stop", "stop-both", "pause", "pause-both", "forge", "inside",
         "stranger", "unlink", "folder", "taken")  # fmt: skip
LOSES = {"kill": 1, "leave": 1, "stop": 1, "stop-both": 2}  # heads that cannot take part

FORGER = """
import json, socket, sys, threading, time
import zenoh
from agents.messages.codec import encode
from agents.messages.kinds import Commit, Envelope, Goodbye, Hello, Proposal, Stage
told = json.loads(sys.stdin.readline())
config = zenoh.Config()
for key, value in told["settings"].items():
    config.insert_json5(key, json.dumps(value))
session = zenoh.open(config)
digest, numbers = "ab" * 16, range(2**62, 2**62 + 10**6)
words = [Hello(digest, 3, "left", True), Goodbye("", "forged"), Goodbye(digest, "forged"),
         Proposal((0, 1), {}, 0.0, digest), Commit((0, 1), digest, Stage.RELEASED, 9, (9, 9))]
names = ["hello", "goodbye", "goodbye", "proposal", "commit"]
tokens, ends = [], time.monotonic() + told["seconds"]
def knock():
    while time.monotonic() < ends:
        for place in told["settings"]["connect/endpoints"]:
            try:
                with socket.socket(socket.AF_UNIX) as raw:
                    raw.connect(place.partition("/")[2])
                    raw.sendall(bytes(1000))
            except OSError:
                pass
        time.sleep(0.01)
threading.Thread(target=knock, daemon=True).start()
number = 0
while time.monotonic() < ends:
    for head in (0, 1):
        root = f"decmcts/v3/{told['session']}/{head}"
        for word, name in zip(words, names):
            payload = encode(Envelope(head, 2**61, numbers[number % 10**6], word))
            session.put(f"{root}/msg/{name}", payload)
            number += 1
        if len(tokens) < 500:
            token = f"{root}/alive/{2**61 + len(tokens)}/{'0' * 32}"
            tokens.append(session.liveliness().declare_token(token))
    time.sleep(0.0005)
session.close()
"""

STRANGER = """
import os, socket, sys
for line in sys.stdin:
    place = line.strip()
    for attempt in (lambda: os.listdir(os.path.dirname(place)), lambda: os.remove(place),
                    lambda: socket.socket(socket.AF_UNIX).connect(place)):
        try:
            attempt()
        except OSError:
            continue
        print("got in")
"""


@dataclass(slots=True)
class Disturber:
    """Disturbs one launch; told of its progress, asked ten times a second."""

    kind: str
    head: int
    after_s: float  # since the agents were started
    pause_s: float
    meeting: Meeting
    pids: dict[int, int] = field(default_factory=dict)
    began: float = 0.0
    ready: float | None = None
    is_struck: bool = False
    others: list[subprocess.Popen[bytes]] = field(default_factory=list)
    said: str = ""

    def learn(self, pids: Mapping[int, int]) -> None:
        """Take the process ids of the agents this program started."""
        self.pids, self.began = dict(pids), time.monotonic()

    def watch(self, status: Sequence[AgentStatus]) -> None:
        """Note when all agents were ready."""
        if self.ready is None and all(s.phase != "starting" for s in status):
            self.ready = time.monotonic()

    def step(self) -> bool:
        """Strike when it is time; never stops the launch."""
        if not self.is_struck and time.monotonic() - self.began >= self.after_s:
            self.is_struck = True
            self.strike()
        return False

    def strike(self) -> None:
        """Do what this kind of disturbance is."""
        heads = sorted(self.pids) if self.kind.endswith("-both") else [self.head]
        first = {"kill": signal.SIGKILL, "leave": signal.SIGTERM}
        if self.kind in first or self.kind.startswith(("stop", "pause")):
            self.signal(heads, first.get(self.kind, signal.SIGSTOP))
        if self.kind.startswith("pause"):
            self.later(lambda: self.signal(heads, signal.SIGCONT))
        if self.kind in ("unlink", "folder"):
            self.remove(heads)
        if self.kind in ("forge", "inside"):
            self.forge()
        if self.kind == "stranger":
            self.visit()

    def later(self, act: Callable[[], None]) -> None:
        """Do something when the pause is over."""
        threading.Timer(self.pause_s, act).start()

    def signal(self, heads: Sequence[int], number: int) -> None:
        """Send a signal to agents that are there."""
        for head in heads:
            with suppress(ProcessLookupError):
                os.kill(self.pids[head], number)

    def folder(self) -> Path:
        """Return where the agents meet."""
        return Path(self.meeting.places[0].removeprefix(UNIX)).parent

    def remove(self, heads: Sequence[int]) -> None:
        """Remove the sockets or their folder, half of the time while a head is stopped."""
        if self.pause_s > 2.5:
            self.signal(heads, signal.SIGSTOP)
            self.later(lambda: self.signal(heads, signal.SIGCONT))
        if self.kind == "folder":
            shutil.rmtree(self.folder(), ignore_errors=True)
        for found in self.folder().glob("[0-9]*"):
            with suppress(OSError):
                found.unlink()

    def forge(self) -> None:
        """Let another process of this user forge and flood for as long as the launch takes."""
        known: dict[str, Any] = {
            "mode": "client" if self.pause_s < 2.5 else "peer",
            "listen/endpoints": [],
            "connect/endpoints": list(self.meeting.places),
            "scouting/multicast/enabled": False,
        }
        if self.kind == "inside":
            known |= {"mode": "peer", "transport/auth/usrpwd/user": "decmcts",
                      "transport/auth/usrpwd/password": self.meeting.seal.password}  # fmt: skip
        told = {"settings": known, "session": self.meeting.seal.session, "seconds": 6.0}
        self.start([sys.executable, "-c", FORGER], str(told).replace("'", '"')
                   .replace("False", "false"))  # fmt: skip

    def visit(self) -> None:
        """Let another user try to get in; only who may change users can try."""
        if os.getuid() == 0 and shutil.which("setpriv"):
            user = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
            places = [place.removeprefix(UNIX) for place in self.meeting.places]
            self.start([*user, "/usr/bin/python3", "-c", STRANGER], "\n".join(places))

    def start(self, command: Sequence[str], told: str) -> None:
        """Start a process that disturbs, and tell it what it may know."""
        pipe, path = subprocess.PIPE, {**os.environ, "PYTHONPATH": str(ROOT)}
        process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL,
                                   env=path)  # fmt: skip
        assert process.stdin is not None
        process.stdin.write(told.encode() + b"\n")
        process.stdin.close()
        self.others.append(process)

    def end(self) -> list[str]:
        """End what was started; return what is wrong."""
        wrong = []
        for process in self.others:
            process.kill()
            assert process.stdout is not None
            with process, process.stdout as said:  # closes its pipes, and waits for it
                wrong += [f"another user {line.decode().strip()}" for line in said]
        left = [pid for pid in self.pids.values() if Path(f"/proc/{pid}").exists()]
        wrong += [f"{len(left)} processes left"] if left else []
        return wrong + ([f"{self.folder()} left"] if self.folder().exists() else [])


def disturber_of(seed: int, kind: str, meeting: Meeting) -> Disturber:
    """Return what disturbs a run."""
    rng = np.random.default_rng([seed, KINDS.index(kind), 42])
    last_s = 0.3 if kind in ("forge", "inside", "stranger") else 1.5 + LIMIT_S  # they take a while
    after_s = float(rng.uniform(0.0, last_s))
    return Disturber(kind, int(rng.integers(2)), after_s, float(rng.uniform(0.2, 5.0)), meeting)


def disturbed(seed: int, kind: str) -> dict[str, Any]:
    """Make one run; return what came of it."""
    os.environ["TOY_HEADS"] = "left,right"
    with ExitStack() as stack:
        places = stack.enter_context(Places(2))
        at = places.fresh()
        if kind == "taken":
            at = places.fresh()  # ports
            taken = stack.enter_context(socket.socket())
            taken.bind(("127.0.0.1", int(at[0].rpartition(":")[2])))
            taken.listen()
        disturber = disturber_of(seed, kind, Meeting(at, os.urandom(32)))
        found, why = None, ""
        try:
            found = run_agents(
                ["left", "right"], [], stopping=Stopping(LIMIT_S, asked=disturber.step), seed=seed,
                command=TOY, meeting=disturber.meeting, on_start=disturber.learn,
                on_progress=disturber.watch,
            )  # fmt: skip
        except LaunchError as error:
            why = str(error)
        took = time.monotonic() - (disturber.ready or disturber.began)
    wrong = faults(found, LOSES.get(kind, 0) if disturber.is_struck else 0, took)
    count = 0 if found is None else counted(found)
    return {"live": 0 if found is None else len(found.live), "took_s": round(took, 2),
            "after_s": round(disturber.after_s, 2), "pause_s": round(disturber.pause_s, 2),
            "counted": count, "why": why, "fault": "; ".join(wrong + disturber.end())}  # fmt: skip


def counted(found: Agreement) -> int:
    """Return how many messages were dropped that nobody of the team said."""
    dropped = (d for agent in found.agents for d in agent.dropped.items())
    return sum(n for reason, n in dropped if reason.startswith(DISTURBS))


def faults(found: Agreement | None, loses: int, took_s: float) -> list[str]:
    """Return what is wrong with a run in which so many heads could not take part."""
    wrong = [f"took {took_s:.1f} s"] if took_s > LIMIT_S + EXTRA_S else []
    if found is None:
        return [*wrong, *(["no plan"] if loses < 2 else [])]
    done = np.sort(np.concatenate(list(found.plans.values())))
    lengths = np.random.default_rng(JOBS).uniform(1.0, 9.0, JOBS)
    makespan = load_balance(lengths, found.plans, found.live)[1]
    if done.tolist() != list(range(JOBS)) or makespan != found.makespan_s:
        wrong.append("not a plan")
    lost = [f"{a.name}: {a.note}" for a in found.agents if a.head not in found.live]
    return [*wrong, *([f"joint plan lost ({'; '.join(lost)})"] if len(lost) > loses else [])]


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Make one run."""
    return key | disturbed(key["seed"], key["kind"]) | {"error": ""}


def report(rows: list[dict[str, str]], said: str) -> str:
    """Return the page."""
    bad = [r for r in rows if r["fault"]]
    text = f"# Launches that are disturbed\n\n{said}\n\n"
    text += "Repeat: `python benchmarks/disturbances.py`. " + " ".join(
        (__doc__ or "").split("\n\n", 2)[2].split()
    )
    text += "\n\nJoint plans: runs that end with a plan of both heads. Took: from when both agents "
    text += "are ready to the result. Counted: messages that were dropped as forged.\n\n"
    text += f"{len(rows)} runs, {len(bad)} faults.\n\n"
    lines = [
        [kind, str(len(group)), str(sum(r["live"] == "2" for r in group)),
         str(sum(r["live"] == "1" for r in group)), f"{max(float(r['took_s']) for r in group):.1f}",
         str(sum(int(r["counted"]) for r in group))]
        for (kind,), group in sorted(grouped(rows, "kind").items())
    ]  # fmt: skip
    head = ["kind", "runs", "joint plans", "plans of one head", "took s, worst", "counted"]
    text += markdown(lines, head)
    wrong = [f"- {r['kind']} {r['seed']}: {r['fault']} {r['why']}\n" for r in bad]
    return text + ("\n## Faults\n\n" + "".join(wrong) if wrong else "")


def main() -> None:
    """Make the runs that are missing, then the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=200, help="all kinds in turn")
    parser.add_argument("--seed", type=int, default=0, help="of the first run")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--table-only", action="store_true", help="run nothing")
    parser.add_argument("--note", default="", help="said beside the setting")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder that is written")
    options = parser.parse_args()
    rows = Rows(options.results / "disturbances.csv", KEY)
    kinds = options.kinds.split(",")
    if not options.table_only:
        keys = [{"seed": options.seed + i // len(kinds), "kind": kinds[i % len(kinds)]}
                for i in range(options.runs)]  # fmt: skip
        run_missing(rows, keys, run)
    said = setting(note=options.note)
    (options.results / "disturbances.md").write_text(report(rows.rows, said))


if __name__ == "__main__":
    main()
