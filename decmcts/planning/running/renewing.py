"""The rest of a print planned anew while the heads that live go on, in a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from decmcts.errors import InputError, VerificationError
from decmcts.planning.events import Report, unheard
from decmcts.planning.options import Cut, TeamSearch
from decmcts.planning.problem.source import Source
from decmcts.planning.replanning.replan import replan, rest_of, rules_of
from decmcts.planning.replanning.rest import LeftBeads
from decmcts.planning.running.parking import parking_plan
from decmcts.print.machine import Machine, Point
from decmcts.print.plan import PlanDocument
from decmcts.print.print_state import PrintState


@dataclass(frozen=True, slots=True)
class Begin:
    """From where the rest is planned."""

    document: PlanDocument  # the plan that is broken off
    whole: Machine  # with all heads of the first plan
    source: Source
    state: PrintState  # when heads have done what they go on with
    standing: Mapping[str, Point]  # heads that go to their parks, and where they stand then
    fenced: Mapping[str, Point]  # heads of that plan that print no more, and where they will stand
    obstacles: Mapping[str, Point]  # heads that do not move, those that failed before too


@dataclass(frozen=True, slots=True)
class Parking:
    """A plan by which heads go to their parks."""

    token: int
    document: PlanDocument


@dataclass(frozen=True, slots=True)
class Renewed:
    """The rest, planned and judged."""

    token: int
    document: PlanDocument
    source: Source  # it alone, from which it may be planned once more
    left_out: int  # contours that no living head can finish
    lines: tuple[str, ...]  # what is missing


@dataclass(frozen=True, slots=True)
class NotRenewed:
    """The rest cannot be planned."""

    token: int
    why: str
    parked: bool  # heads were sent to their parks before that was known


News = Parking | Renewed | NotRenewed


def renew(
    token: int, begin: Begin, seconds: float, seed: int, left: LeftBeads,
    tell: Callable[[News], None], report: Report = unheard,
) -> threading.Thread:  # fmt: skip
    """Plan the rest in a thread; report paths to the parks once they are found, and the plan."""

    def work() -> None:
        parked = False
        try:
            rest = rest_of(begin.document, begin.source, begin.state, begin.fenced, left, report)
            parking = parking_plan(begin.document, begin.whole, begin.standing, begin.obstacles)
            if parking is not None:
                tell(Parking(token, parking))
                parked = True
            cut = Cut.NONE if begin.document.rules is None else Cut(begin.document.rules.cut)
            search = TeamSearch(seconds, seed, cut=cut)
            result = replan(rest, search, rules_of(begin.document), writes=False, report=report)
            found = tuple(rest.unfinished)
            tell(Renewed(token, result.document, rest.source, int(rest.left.rows.sum()), found))
        except (InputError, VerificationError) as error:
            tell(NotRenewed(token, " ".join(str(error).split()), parked))
        except Exception as error:  # whatever it is, heads must not wait for it for ever
            tell(NotRenewed(token, f"internal error: {type(error).__name__}: {error}", parked))

    thread = threading.Thread(target=work, name="renew", daemon=True)
    thread.start()
    return thread
