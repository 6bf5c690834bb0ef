"""Run finished files, or a plan, as controllers run them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import sim.controllers
from decmcts.arguments import checked
from decmcts.errors import InputError
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.machines.own_machine import machine_of_text
from decmcts.formats.plans.plan_json import is_plan, read_plan
from decmcts.jit import cache_folder
from decmcts.planning.events import Note, Report, Step, unheard
from decmcts.print.brief import brief
from decmcts.print.machine import Head, Machine
from decmcts.print.plan import PlanDocument
from decmcts.print.print_events import PrintEvent
from sim.controllers.from_files import programs_of_files
from sim.controllers.from_plan import programs_of_plan
from sim.controllers.motion import QUEUE
from sim.controllers.print_contacts import Material, material_of_files, material_of_plan
from sim.controllers.program import HeadProgram
from sim.controllers.simulate import Simulation, Trial, events_of, too_soon
from sim.controllers.simulate import simulate as run
from sim.controllers.timing import Timing
from sim.heads.file import header_of

_USUAL = "dual-gantry"  # of files of several heads, where no machine is named
USUAL_HEADS = f"no machine is named: heads are taken to be those of {_USUAL}; else name --machine"
OWN_ACTIONS = "the plan's own actions are run; name the files of its heads too to run those"
SAME_SHARE, SAME_MM = 0.01, 5.0  # by which files may lay more or less than their plan: rounding
NO_PRINTER = (
    "no printer is known: usual limits of motion count where the file states none; name --machine"
)


@dataclass(frozen=True, slots=True)
class Simulated:
    """What was run, and what came of it."""

    simulation: Simulation
    machine: Machine
    plan: PlanDocument | None  # None: files without a plan

    cools: bool = False  # whether the plan's rule of cooling was looked at
    looked_at_print: bool = False  # whether contacts of heads with the print were

    __repr__ = brief("machine.name", "planned_s", "simulation")

    @property
    def planned_s(self) -> float | None:
        """The plan's makespan; None without a plan."""
        return None if self.plan is None else self.plan.plan.makespan_s

    @property
    def events(self) -> tuple[PrintEvent, ...]:
        """What happened without errors of time, in the order of seconds (docs/events.md)."""
        return events_of(self.simulation).events


@checked
def simulate(
    inputs: Sequence[str | Path], machine: str | Machine | None = None, *,
    timing: Timing = Timing.NONE, size: float = 0.2, trials: int = 10, seed: int = 0,
    queue: int = QUEUE, report: Report = unheard,
) -> Simulated:  # fmt: skip
    """Run finished G-code, of any slicer or of all heads, or a plan, in simulated controllers.

    Parameters
    ----------
    inputs : Sequence[str | Path]
        A plan.json, with or without the files of its heads; or files of all heads; or any one
        G-code file.
    machine : str | Machine | None
        The printer; None: the plan's, else the one the file names, of several heads
        `dual-gantry`.
    timing, size, trials, seed
        Errors of time, how large they are (0.2: 20 % of the time), how often they are drawn, and
        from which seed.
    queue : int
        Moves that a controller plans ahead.
    report : Report
        Told what is done.

    Raises
    ------
    InputError
        When a file cannot be read, or files do not belong together.

    Examples
    --------
    >>> from decmcts import sample_path, simulate
    >>> found = simulate([sample_path("four_nuts.gcode.gz")])
    >>> round(found.simulation.makespan_s) > 0
    True
    """
    _refuse(size, trials, queue)
    paths = [Path(each) for each in inputs]
    plans = [path for path in paths if is_plan(path)]
    files = [path for path in paths if path not in plans]
    if len(plans) > 1:
        raise InputError("one plan can be run, not several", path=plans[1])
    if not inputs:
        raise InputError("inputs names no file")
    report(Step("reading"))
    plan = read_plan(plans[0]) if plans else None
    chosen = _machine_of(plan, machine, files, report)
    programs = _programs(plan, files, chosen, queue, report)
    compiled = Path(cache_folder(Path(sim.controllers.__file__).parent)).exists()
    report(Step("running" if compiled else "running, which the first time compiles for a minute"))

    def on_trial(trials: Sequence[Trial], of: int) -> None:
        report(Step(f"running with errors of time{so_far(trials)}", len(trials), of))

    judged = plan if plan is not None and not files and plan.min_layer_time_s > 0.0 else None
    material: Material | None = None  # heads without a shape meet nothing
    if any(head.slices or head.bodies for head in chosen.heads):
        if plan is not None and not files:
            material = material_of_plan(plan, programs)
        else:
            material = material_of_files(programs)
    found = run(
        programs, chosen, timing=timing, size=size, trials=trials, seed=seed, queue=queue,
        on_trial=on_trial, too_soon=lambda one: too_soon(judged, programs, one) if judged else (),
        material=material,
    )  # fmt: skip
    return Simulated(found, chosen, plan, judged is not None, material is not None)


def so_far(trials: Sequence[Trial]) -> str:
    """Return in words how near heads have come, and what was touched."""
    gaps = [near.gap_mm for trial in trials for near in trial.near]
    touched = sum(len(trial.contacts) + len(trial.on_print) for trial in trials)
    nearest = f"heads {min(gaps):.1f} mm apart at least, " if gaps else ""
    return f": {nearest}{touched} contacts so far"


def _refuse(size: float, trials: int, queue: int) -> None:
    if not 0.0 <= size < 1.0:
        raise InputError(f"errors of {size:g} times the time: from 0 to below 1 are possible")
    if trials < 1:
        raise InputError(f"{trials} trials are none")
    if queue < 1:
        raise InputError(f"a queue of {queue} moves is none")


def _machine_of(
    plan: PlanDocument | None, machine: str | Machine | None, files: Sequence[Path], report: Report,
) -> Machine:  # fmt: skip
    if plan is not None:
        if machine is not None:
            raise InputError(
                "a plan has its machine", advice="leave --machine out, or run the files alone"
            )
        return plan.machine
    if machine is not None:
        return machine if isinstance(machine, Machine) else load_machine(machine)
    if len(files) > 1:
        report(Note(USUAL_HEADS))
        return load_machine(_USUAL)
    text = load_text(files[0])
    if header_of(text)[0]:
        return load_machine(_USUAL)  # and then its other files are missed
    try:
        return machine_of_text(text, files[0])[0]
    except InputError:  # one head alone touches no other; its shape is not known
        report(Note(NO_PRINTER))
        return Machine("a printer with usual limits", (0.0, 0.0), (0.0, 0.0), (Head("head", ()),))


def _programs(
    plan: PlanDocument | None, files: Sequence[Path], machine: Machine, queue: int, report: Report
) -> tuple[HeadProgram, ...]:
    """Return what each controller is given, in the order of the plan's heads or of the files."""
    if plan is not None and not files:
        if len(plan.machine.heads) > 1:
            report(Note(OWN_ACTIONS))
        return programs_of_plan(plan, queue)
    programs = programs_of_files(files, machine)
    due = [head.name for head in machine.heads] if plan is None else [
        actions.head for actions in plan.plan.heads
    ]  # fmt: skip
    named = [program.name for program in programs]
    if len(files) > 1 and named != due:
        raise InputError(
            f"these are files of heads {', '.join(named)}; "
            f"{'machine ' + machine.name if plan is None else 'the plan'} has {', '.join(due)}",
            advice="name the files of all heads, and the machine they are for",
        )
    if plan is not None:
        _refuse_others(programs, programs_of_plan(plan, queue), files)
    return programs


def _refuse_others(
    programs: Sequence[HeadProgram], due: Sequence[HeadProgram], files: Sequence[Path]
) -> None:
    """Raise InputError where files lay other lengths of beads than the heads of the plan do."""
    for file, planned, path in zip(programs, due, files, strict=False):
        lays, should = file.laid_mm, planned.laid_mm
        if abs(lays - should) > SAME_SHARE * should + SAME_MM:
            raise InputError(
                f"head {planned.name} lays {lays:,.0f} mm of beads here, {should:,.0f} mm in the "
                "plan",
                path=path, advice="name the files that were made with this plan",
            )  # fmt: skip
