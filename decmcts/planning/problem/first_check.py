"""The source's own order, judged and written before any result.

A fault that every order would have (a text that cannot be written again, a contact of head
and print) is found here, in time linear in the print, and not after minutes of search. Of a
large print the text is judged beside the search. The draft that is written is deleted, so its
faults are said in lines of the source.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from decmcts.arrays import Int32s, Ints
from decmcts.errors import InputError
from decmcts.formats.files.atomic import draft_folder
from decmcts.formats.gcode import read_motions, write_gcode
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.print.plan import PlanDocument
from sim.faults import Verdict
from sim.files.written import verify_written
from sim.verify import verify_plan


def refuse_unsound(problem: PrintProblem, before: PlanDocument) -> None:
    """Raise InputError where the plan of the source's own order for one head has faults."""
    verdict = verify_plan(before, source=problem.job, trials=0)
    if not verdict.ok:
        raise _refusal(problem, verdict, None)


def refuse_unwritable(
    problem: PrintProblem, before: PlanDocument, *, verify: Callable[..., Verdict] = verify_written
) -> tuple[str, ...]:
    """Raise InputError where the source's own order, planned as `before`, has faults as written.

    Returns what is bad in the text, and is the source's own.
    """
    with draft_folder() as folder:
        draft = Path(folder) / "draft.gcode"
        actions = before.plan.heads[0]
        write_gcode(problem.document, problem.job, actions, draft)
        verdict = verify(draft, problem.job, problem.document, problem.machine, actions=actions)
        if not verdict.ok:
            lines = SourceLines.of(draft, problem.job.contours.line)
            raise _refusal(problem, verdict, lines)
    return verdict.warnings


def _refusal(problem: PrintProblem, verdict: Verdict, lines: SourceLines | None) -> InputError:
    count, shown = len(verdict.faults), verdict.shown
    shown = shown if lines is None else lines.stated(shown)
    line = None if lines is None else lines.first(verdict.faults[0].text)
    return InputError(
        f"in its own order this print fails verification with {count} fault{'s' * (count > 1)}, "
        f"so no other order is searched: {shown}",
        path=problem.path,
        line=line,
        advice="export the G-code again, and report this if it stays so",
    )


_LINE = re.compile(r"\bline (\d+)")


@dataclass(frozen=True, slots=True)
class SourceLines:
    """Of each line of a draft the source's line of the contour that stands there, or next."""

    line: Ints  # (k,) of the draft's beads, ascending
    source: Ints  # (k,) where the source begins the contour of each

    @staticmethod
    def of(draft: Path, contour_lines: Int32s) -> SourceLines:
        """Return the lines of a draft whose contours stand in the order of `contour_lines`.

        Of none where it cannot be read.
        """
        none = np.zeros(0, np.int64)
        try:
            motions = read_motions(draft)
        except InputError:
            return SourceLines(none, none)
        contour = np.asarray(motions.contour)
        known = np.flatnonzero((contour >= 0) & (contour < len(contour_lines)))
        source = contour_lines[contour[known]].astype(np.int64)
        return SourceLines(np.asarray(motions.line, np.int64)[known], source)

    def at(self, line: int) -> int | None:
        """Return the source's line for a line of the draft; None where nothing is printed on."""
        k = int(np.searchsorted(self.line, line))
        return (int(self.source[k]) or None) if k < len(self.line) else None

    def first(self, text: str) -> int | None:
        """Return the source's line for the first line that a text names."""
        named = _LINE.search(text)
        return None if named is None else self.at(int(named[1]))

    def stated(self, text: str) -> str:
        """Return a text with the lines it names as lines of the source."""
        return _LINE.sub(lambda named: f"line {self.at(int(named[1])) or named[1]}", text)
