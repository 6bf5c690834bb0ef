"""Judge a plan or finished files again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from decmcts.arguments import checked
from decmcts.errors import InputError
from decmcts.planning.events import Report, Step, unheard
from decmcts.planning.verifying.held import AS_STATED, Held
from decmcts.planning.verifying.judge import (
    Judging,
    is_whole_team,
    judge,
    judge_several,
    refuse_plate,
)
from decmcts.print.machine import Machine
from sim.faults import Verdict


@checked
def verify(
    result: str | Path | Sequence[str | Path],
    source: str | Path | None = None,
    machine: str | Machine | None = None,
    *,
    plan: str | Path | None = None,
    plate: int | None = None,
    held: Held = AS_STATED,
    trials: int = 3,
    seed: int = 0,
    report: Report = unheard,
) -> Verdict:
    """Replay a plan or finished G-code, by logic that shares nothing with the planners'.

    Parameters
    ----------
    result : str | Path | Sequence[str | Path]
        A plan.json, a G-code file, or the files of all heads.
    source : str | Path | None
        The G-code it was made from; a plan.json can do without.
    machine : str | Machine | None
        The printer; None: the one the plan or the source names.
    plan : str | Path | None
        Of files of several heads: the plan.json they were made from.
    plate : int | None
        Of a .gcode.3mf, result or source: whose G-code; None: the only one's that has any.
    held : Held
        Rules that replace those a plan states.
    trials : int
        Number of random timings in which a joint plan is replayed.
    seed : int
        Seed of these timings.
    report : Report
        Told what is done.

    Returns
    -------
    Verdict
        All faults found; `ok` if there are none.

    Raises
    ------
    InputError
        When a file cannot be read, or the source or machine it must be compared with is missing.

    Examples
    --------
    >>> from decmcts import sample_path, verify
    >>> nuts = sample_path("four_nuts.gcode.gz")
    >>> verify(nuts, source=nuts, machine="mk4s").ok
    True
    """
    several = [result] if isinstance(result, str | Path) else result
    files = [Path(one) for one in several]
    given, made_from = (None if one is None else Path(one) for one in (source, plan))
    if not files:
        raise InputError("no file to verify")
    for path in files:
        if not path.exists():
            raise InputError("no such file", path=path)
    report(Step(f"verifying {', '.join(path.name for path in files)}"))
    asked = Judging(machine, held, seed, trials, plate)
    refuse_plate(plate, [*files, *([] if given is None else [given])])
    if len(files) > 1 or made_from is not None or is_whole_team(files[0], plate):
        return judge_several(files, given, made_from, asked)
    return judge(files[0], given, asked, report)
