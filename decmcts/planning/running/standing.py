"""What the launcher knows of each head, and how that is shown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from agents.running.report import NOTHING
from decmcts.planning.running.options import Failure, HeadView, RunView
from decmcts.planning.running.recorded import Carried
from decmcts.print.plan import ActionKind

_DOES = {
    ActionKind.PRINT: "prints", ActionKind.TRAVEL: "travels", ActionKind.PARK: "parks",
    ActionKind.WAIT: "rests",
}  # fmt: skip


@dataclass(slots=True)
class Standing:
    """What is known of one head."""

    name: str
    number: int = -1  # of the plan its controller holds
    paused: bool = False  # a person asked for it
    waits_for: int | None = None
    missing: tuple[int, ...] = ()  # heads its agent does not hear
    pulse_at: float = -math.inf
    heard_at: float = math.inf  # its controller
    agent_gone: str = ""
    replaced: bool = False  # its agent; that the one before has ended was not heard yet
    controller_gone: str = ""
    asked: bool = False  # a person, where it is
    fenced: bool = False
    parks: bool = False  # it prints no more, but its controller takes it to its park
    failure: Failure | None = None


def view_of(heads: Sequence[Standing], plans: Sequence[Carried], time_s: float) -> RunView:
    """Return how heads stand."""
    found = []
    for h, head in enumerate(heads):
        carried = plans[max(head.number, 0)]
        if h not in carried.heads:
            continue
        reached = carried.reached.get(h, NOTHING)
        actions = carried.document.plan.heads[carried.heads.index(h)]
        share = reached.ended / max(len(actions), 1)
        if head.failure is not None:
            does = f"{'off' if head.fenced else 'lost'}: {head.failure.why}"
        elif head.paused:
            does = "paused"
        elif not carried.is_print:
            does = "goes to its park"
        elif reached.begun and reached.ended < len(actions):
            does = _DOES[ActionKind(int(actions.kind[reached.ended]))]
        else:
            does = "stands"
        waits = "" if head.waits_for is None else heads[head.waits_for].name
        found.append(HeadView(head.name, does, share, waits if does == "stands" else ""))
    return RunView(time_s, plans[0].document.plan.makespan_s, tuple(found))
