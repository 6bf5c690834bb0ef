"""Agents as real processes that are killed, stopped and restarted at random times.

    python benchmarks/struck_agents.py [--runs 200] [--planner toy|team]

Each run starts a launch with 2 to 4 heads (`team`: 2, a small print on dual-gantry,
judged by `sim`; `toy`: 40 jobs) and one or two strikes at random times, from while
agents meet until after planning. Kinds: `kill` (kill -9), `stop` (SIGSTOP for
good), `pause` (SIGSTOP, SIGCONT up to 4 s later), `restart` (kill -9, then an agent
of the same head started by hand, half of them with an earlier clock), `leave`
(SIGTERM). A run ends with a valid plan or with one line of refusal; anything else
is a fault, and so is a process that is left.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from common import RESULTS, ROOT, Rows, grouped, markdown, run_missing, setting, spread

from agents.launch import launch
from agents.launching.spawn import run_agents
from agents.launching.supervisor import AgentStatus, LaunchError
from agents.planners.source import load_source
from decmcts.print.plan import PlanDocument
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.schedule.joint_plan import schedule
from sim.experiments.made_print import made_gcode
from sim.verify import verify_plan
from tests.agents.toy import load_balance

KEY = ("planner", "seed")
KINDS = ("kill", "stop", "pause", "restart", "leave")
TOY = (sys.executable, str(ROOT / "tests" / "integration" / "toy_agent.py"))
LIMIT_S = {"toy": 2.0, "team": 4.0}
JOBS = 40


@dataclass(slots=True)
class Strike:
    """What happens to one agent, and what came of it; changed in place."""

    kind: str
    head: int
    after_s: float  # since the first agent was ready
    pause_s: float
    earlier: bool  # clock of the restarted agent
    struck: float | None = None  # time
    noticed: float | None = None  # by every agent that was not struck
    resumed: bool = False


@dataclass(slots=True)
class Striker:
    """Carries out the strikes of one run; told of the launch's progress."""

    strikes: list[Strike]
    pids: dict[int, int] = field(default_factory=dict)
    commands: dict[int, list[str]] = field(default_factory=dict)
    restarted: list[subprocess.Popen[bytes]] = field(default_factory=list)
    began: float | None = None
    planned: float | None = None  # first agent that agrees

    def learn(self, pids: Mapping[int, int]) -> None:
        """Take the process ids of the agents this program started."""
        self.pids = dict(pids)

    def _learn_commands(self) -> None:
        """Note how the agents were started; right after its start a process shows no words."""
        for head, pid in self.pids.items():
            line = Path(f"/proc/{pid}/cmdline").read_bytes()
            self.commands[head] = line.decode().rstrip("\0").split("\0")

    def watch(self, status: Sequence[AgentStatus]) -> None:
        """Strike when it is time, and note when the others noticed."""
        if self.began is None and any(s.phase != "starting" for s in status):
            self.began = time.monotonic()
            self._learn_commands()
        if self.planned is None and any(s.phase in ("agreeing", "released") for s in status):
            self.planned = time.monotonic()
        for strike in self.strikes:
            self._notice(strike, status)

    def step(self) -> bool:
        """Do what is due; asked ten times a second. Never stops the launch."""
        now = time.monotonic()
        for strike in self.strikes:
            if strike.struck is None:
                if self.began is not None and now - self.began >= strike.after_s:
                    self._strike(strike)
            elif self._is_over(strike, now):
                strike.resumed = True
                self._signal(strike.head, signal.SIGCONT)
        return False

    @staticmethod
    def _is_over(strike: Strike, now: float) -> bool:
        """Whether a stopped agent is to go on now."""
        if strike.kind != "pause" or strike.resumed or strike.struck is None:
            return False
        return now - strike.struck >= strike.pause_s

    def _strike(self, strike: Strike) -> None:
        strike.struck = time.monotonic()
        first = {"stop": signal.SIGSTOP, "pause": signal.SIGSTOP, "leave": signal.SIGTERM}
        self._signal(strike.head, first.get(strike.kind, signal.SIGKILL))
        if strike.kind == "restart":
            self._restart(strike)

    def _signal(self, head: int, number: signal.Signals) -> None:
        pid = self.pids[head]
        if is_ours(pid):  # the launcher may have ended it
            os.kill(pid, number)

    def _restart(self, strike: Strike) -> None:
        """Start the head's agent again as a user would, by hand."""
        command = [word for word in self.commands[strike.head] if word != "--controlled"]
        at = command.index("--epoch") + 1
        command[at] = str(int(command[at]) + (-3_600_000 if strike.earlier else 5_000))
        self.restarted.append(
            subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        )

    def _notice(self, strike: Strike, status: Sequence[AgentStatus]) -> None:
        if strike.struck is None or strike.noticed is not None:
            return
        struck = {s.head for s in self.strikes}
        others = [s for s in status if s.head not in struck and s.phase != "lost"]
        if others and all(s.live and strike.head not in s.live for s in others):
            strike.noticed = time.monotonic()

    def end(self) -> int:
        """End what was restarted; return how many processes of the run are left."""
        for process in self.restarted:
            process.terminate()
        for process in self.restarted:
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                return 1
        return sum(is_ours(pid) for pid in self.pids.values())


def is_ours(pid: int) -> bool:
    """Whether a process is there and one of an agent's (ids are used again)."""
    try:
        return b"--head" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False


def strikes_of(planner: str, seed: int) -> tuple[int, list[Strike]]:
    """Return how many heads a run has and what strikes them."""
    rng = np.random.default_rng([seed, 11])
    heads = 2 if planner == "team" else int(rng.integers(2, 5))
    count = 1 + int(heads > 2 and rng.random() < 0.4)
    struck = rng.choice(heads, count, replace=False)
    last = LIMIT_S[planner] + 1.0
    return heads, [
        Strike(
            str(rng.choice(KINDS)),
            int(head),
            float(rng.uniform(0.0, last)),
            float(rng.uniform(0.1, 4.0)),
            bool(rng.random() < 0.5),
        )
        for head in struck
    ]


def toy_run(heads: int, seed: int, striker: Striker) -> tuple[str, str]:
    """Let agents over the toy problem agree; return the outcome and what is wrong with it."""
    os.environ["TOY_HEADS"] = ",".join(f"head{h}" for h in range(heads))
    agreement = run_agents(
        [f"head{h}" for h in range(heads)],
        [],
        stopping=Stopping(LIMIT_S["toy"], asked=striker.step),
        seed=seed,
        command=TOY,
        on_start=striker.learn,
        on_progress=striker.watch,
    )
    done = np.sort(np.concatenate(list(agreement.plans.values())))
    lengths = np.random.default_rng(JOBS).uniform(1.0, 9.0, JOBS)
    makespan = load_balance(lengths, agreement.plans, agreement.live)[1]
    fine = done.tolist() == list(range(JOBS)) and makespan == agreement.makespan_s
    return f"plan of {len(agreement.live)}", "" if fine else "not a plan"


def team_run(heads: int, seed: int, striker: Striker) -> tuple[str, str]:
    """Let agents plan a small print; return the outcome and what the judge makes of it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "towers.gcode")
        path.write_text(made_gcode([(110.0, 100.0), (170.0, 100.0), (230.0, 100.0)]))
        pack = load_source(path, "dual-gantry", "keep")
    job, machine, graph = pack.job, pack.machine, pack.graph
    result = launch(
        job,
        machine,
        graph,
        stopping=Stopping(LIMIT_S["team"], asked=striker.step),
        seed=seed,
        on_start=striker.learn,
        on_progress=striker.watch,
    )
    plan = schedule(job, machine, graph, list(result.toolpaths))
    document = PlanDocument(result.problem, machine, job.contours, graph.pairs(), plan, {})
    verdict = verify_plan(document, source=job, seed=seed)
    fault = "" if verdict.ok else str(verdict.faults[0])
    return f"plan of {len(result.agreement.live)}", fault


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Make one run."""
    planner, seed = key["planner"], key["seed"]
    heads, strikes = strikes_of(planner, seed)
    striker = Striker(strikes)
    try:
        outcome, fault = (toy_run if planner == "toy" else team_run)(heads, seed, striker)
    except LaunchError as error:
        outcome, fault = "refused", "" if "\n" not in str(error) and str(error) else "no one line"
        striker.planned = striker.planned or time.monotonic()
        refusal = str(error)
    else:
        refusal = ""
    ended = time.monotonic()
    times = [s.struck for s in strikes if s.struck is not None]
    noticed = [s.noticed - s.struck for s in strikes if s.noticed and s.struck]
    planned = ended if striker.planned is None else striker.planned
    return key | {
        "heads": heads,
        "strikes": " ".join(f"{s.kind}@{s.after_s:.2f}" for s in strikes if s.struck is not None),
        "outcome": outcome,
        "refusal": refusal,
        "fault": fault,
        "noticed_s": round(max(noticed), 2) if noticed else "",
        "agreed_s": round(ended - max([planned, *times]), 2),
        "left": striker.end(),
        "error": "",
    }


def kinds_of(row: dict[str, str]) -> str:
    """Return the kinds of strikes of a run."""
    kinds = sorted({word.partition("@")[0] for word in row["strikes"].split()})
    return kinds[0] if len(kinds) == 1 else "two kinds" if kinds else "over before the strike"


def report(rows: list[dict[str, str]], said: str) -> str:
    """Return the page."""
    fine = [r for r in rows if not r["error"]]
    faults = [r for r in fine if r["fault"] or r["left"] != "0"]
    text = f"# Agents that are killed, stopped and restarted\n\n{said}\n\n"
    text += "Repeat: `python benchmarks/struck_agents.py` (`--planner team` for the print). Real "
    text += "processes over zenoh on loopback, one or two strikes a run at random times from "
    text += "while the agents meet to a second after planning. kill: kill -9. stop: SIGSTOP for "
    text += "good. pause: SIGSTOP, SIGCONT up to 4 s later. restart: kill -9 and an agent of the "
    text += "same head started by hand, half of them with an earlier clock. leave: SIGTERM. "
    text += "`toy`: 40 jobs, 2 to 4 heads; `team`: a small print on `dual-gantry`, its plans "
    text += "judged by `sim`. Noticed: from the strike until the progress of all others shows them "
    text += (
        "planning without it (progress comes twice a second). Agreed: from the end of planning, "
    )
    text += "or the strike if that is later, to the launcher's result, ends of processes waited "
    text += "for.\n\n"
    text += (
        f"{len(fine)} runs; {sum(r['outcome'] == 'refused' for r in fine)} refused in one line, "
    )
    text += f"the others released a valid plan; {len(faults)} faults, "
    text += f"{sum(int(r['left']) for r in fine)} processes left.\n\n"
    for row in fine:
        row["struck"] = kinds_of(row)
    lines = [line(key, group) for key, group in sorted(grouped(fine, "planner", "struck").items())]
    head = ["planner", "strike", "runs", "plans", "of all heads", "refused", "noticed s",
            "agreed s, median (quartiles)", "worst s"]  # fmt: skip
    text += markdown(lines, head)
    refused = [f"- {r['planner']} {r['seed']} ({r['strikes']}): {r['refusal']}\n"
               for r in fine if r["refusal"]]  # fmt: skip
    text += "\n## Refusals\n\n" + "".join(refused) if refused else ""
    wrong = [f"- {r['planner']} {r['seed']}: {r['fault']}, left {r['left']}\n" for r in faults]
    return text + ("\n## Faults\n\n" + "".join(wrong) if wrong else "")


def line(key: tuple[str, ...], group: list[dict[str, str]]) -> list[str]:
    """Return one line of the table."""
    plans = [r for r in group if r["outcome"] != "refused"]
    whole = sum(r["outcome"] == f"plan of {r['heads']}" for r in plans)
    noticed = [float(r["noticed_s"]) for r in group if r["noticed_s"]]
    agreed = [float(r["agreed_s"]) for r in plans]
    return [*key, str(len(group)), str(len(plans)), str(whole), str(len(group) - len(plans)),
            spread(noticed, 2), spread(agreed, 2), f"{max(agreed, default=0.0):.1f}"]  # fmt: skip


def main() -> None:
    """Make the runs that are missing, then the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=200, help="seeds 0, 1, …")
    parser.add_argument("--planner", choices=tuple(LIMIT_S), default="toy")
    parser.add_argument("--table-only", action="store_true", help="run nothing")
    parser.add_argument("--note", default="", help="said beside the setting")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder that is written")
    options = parser.parse_args()
    rows = Rows(options.results / "struck_agents.csv", KEY)
    if not options.table_only:
        keys = [{"planner": options.planner, "seed": seed} for seed in range(options.runs)]
        run_missing(rows, keys, run)
    said = setting(note=options.note)
    (options.results / "struck_agents.md").write_text(report(rows.rows, said))


if __name__ == "__main__":
    main()
