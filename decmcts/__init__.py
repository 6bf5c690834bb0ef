"""Finds a better, proven-safe order for the extrusions of a 3D print.

`decmcts` computes; `agents` communicates; `sim` judges. See ARCHITECTURE.md. The names below
are what programs use (docs/api.md); each is loaded when it is first asked for, so that
`import decmcts` takes no time.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from decmcts.version import __version__

if TYPE_CHECKING:
    from agents.launching.status import AgentStatus
    from decmcts.errors import InputError, VerificationError
    from decmcts.experiments.run import Experimented, experiment
    from decmcts.formats.bare.qcsp import read_qcsp
    from decmcts.formats.bare.sop import read_sop
    from decmcts.formats.machines.machine_file import load_machine, preset_names
    from decmcts.formats.mesh import SliceOptions
    from decmcts.planning.arrays import from_arrays
    from decmcts.planning.bare import solve_qcsp, solve_sop
    from decmcts.planning.events import (
        Begun,
        Event,
        Heads,
        Note,
        Progress,
        Report,
        Sound,
        Step,
        Stop,
    )
    from decmcts.planning.launch import launch
    from decmcts.planning.one_head.certificate import Certificate
    from decmcts.planning.options import (
        Cut,
        Freedom,
        Held,
        Limits,
        Objective,
        PlannerName,
        ProcessOrder,
        Rules,
        Seam,
        Search,
        TeamSearch,
    )
    from decmcts.planning.plan import plan
    from decmcts.planning.problem.slicing import Slicing, choose_slicer
    from decmcts.planning.problem.source import Source, read
    from decmcts.planning.result import Figures, Result, Written, bound
    from decmcts.planning.simulate import Simulated, simulate
    from decmcts.planning.verify import verify
    from decmcts.print.contours import Role
    from decmcts.print.machine import Machine
    from decmcts.print.print_events import EventKind, PrintEvent
    from decmcts.samples import sample_path
    from decmcts.search.sequence.incumbent import Incumbent
    from decmcts.search.sequence.planner import Planner
    from decmcts.search.sop.solver import SopResult
    from decmcts.team.incumbent import TeamIncumbent
    from decmcts.team.planner import TeamPlanner
    from decmcts.team.qcsp.solver import QcspResult
    from sim.faults import Fault, FaultKind, Verdict

_ROOMS = {
    "agents.launching.status": ("AgentStatus",),
    "decmcts.errors": ("InputError", "VerificationError"),
    "decmcts.experiments.run": ("Experimented", "experiment"),
    "decmcts.formats.machines.machine_file": ("load_machine", "preset_names"),
    "decmcts.formats.mesh": ("SliceOptions",),
    "decmcts.formats.bare.qcsp": ("read_qcsp",),
    "decmcts.formats.bare.sop": ("read_sop",),
    "decmcts.planning.arrays": ("from_arrays",),
    "decmcts.planning.bare": ("solve_qcsp", "solve_sop"),
    "decmcts.planning.events": (
        "Begun", "Event", "Heads", "Note", "Progress", "Report", "Sound", "Step", "Stop",
    ),
    "decmcts.planning.launch": ("launch",),
    "decmcts.planning.one_head.certificate": ("Certificate",),
    "decmcts.planning.options": (
        "Cut", "Freedom", "Held", "Limits", "Objective", "PlannerName", "ProcessOrder", "Rules",
        "Seam", "Search", "TeamSearch",
    ),
    "decmcts.planning.plan": ("plan",),
    "decmcts.planning.problem.slicing": ("Slicing", "choose_slicer"),
    "decmcts.planning.problem.source": ("Source", "read"),
    "decmcts.planning.result": ("Figures", "Result", "Written", "bound"),
    "decmcts.planning.simulate": ("Simulated", "simulate"),
    "decmcts.planning.verify": ("verify",),
    "decmcts.print.contours": ("Role",),
    "decmcts.print.machine": ("Machine",),
    "decmcts.print.print_events": ("EventKind", "PrintEvent"),
    "decmcts.samples": ("sample_path",),
    "decmcts.search.sequence.planner": ("Planner",),
    "decmcts.search.sequence.incumbent": ("Incumbent",),
    "decmcts.search.sop.solver": ("SopResult",),
    "decmcts.team.incumbent": ("TeamIncumbent",),
    "decmcts.team.planner": ("TeamPlanner",),
    "decmcts.team.qcsp.solver": ("QcspResult",),
    "sim.faults": ("Fault", "FaultKind", "Verdict"),
}  # fmt: skip
for _name in ("agents", "sim"):
    if getattr(_package := import_module(_name), "PART_OF", "") != "decmcts":
        raise ImportError(
            f"the package {_name!r} in {_package.__file__} is not that of decmcts: another "
            "distribution or a file of yours has its name; give decmcts an environment of its own"
        )
del _name, _package

_HOME = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = [
    "AgentStatus", "Begun", "Certificate", "Cut", "Event", "EventKind", "Experimented", "Fault",
    "FaultKind", "Figures", "Freedom", "Heads", "Held", "Incumbent", "InputError", "Limits",
    "Machine", "Note", "Objective", "Planner", "PlannerName", "PrintEvent", "ProcessOrder",
    "Progress", "QcspResult", "Report", "Result", "Role", "Rules", "Seam", "Search", "Simulated",
    "SliceOptions", "Slicing", "SopResult", "Sound", "Source", "Step", "Stop", "TeamIncumbent",
    "TeamPlanner", "TeamSearch", "Verdict", "VerificationError", "Written", "__version__", "bound",
    "choose_slicer", "experiment", "from_arrays", "launch", "load_machine", "plan", "preset_names",
    "read", "read_qcsp", "read_sop", "sample_path", "simulate", "solve_qcsp", "solve_sop", "verify",
]  # fmt: skip


def __getattr__(name: str) -> object:
    """Return a public name from the room it lives in."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, loaded or not."""
    return sorted({*globals(), *__all__})
