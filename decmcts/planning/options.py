"""The options of planning: a few frozen dataclasses, each checked when it is made.

Nothing here computes. Names in files and on the command line are the values of the enums.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from decmcts.arguments import check_fields
from decmcts.errors import InputError
from decmcts.formats.files.bounds import MOST_LAYERS
from decmcts.print.machine import Machine
from decmcts.print.plan import OrderRules
from decmcts.search.sequence.planner import Planner
from decmcts.team.planner import TeamPlanner

if TYPE_CHECKING:
    from decmcts.print.job import PrintJob

STAGGER_MM = 1.2  # more than two beads of 0.45 mm: ends of one layer touch none of the next
MOST_STAGGER_MM = 5.0  # farther from where a layer's strips end in step, heads wait for each other


class Freedom(StrEnum):
    """Which traversals of a contour a planner may choose."""

    FIXED = "fixed"
    REVERSIBLE = "reversible"
    SEAM = "seam"


class Seam(StrEnum):
    """Where freedom `seam` may let closed contours begin."""

    NEAREST = "nearest"
    ALIGNED = "aligned"
    REAR = "rear"
    CORNER = "corner"


class PlannerName(StrEnum):
    """The planners for one head that come with the program."""

    SLICER = "slicer"
    LAYERWISE = "layerwise"
    GREEDY = "greedy"
    LOCAL = "local"
    MCTS = "mcts"
    HYBRID = "hybrid"


class Objective(StrEnum):
    """What the search minimises."""

    TRAVEL = "travel"
    TIME = "time"


class Limits(StrEnum):
    """Whose motion limits count where both state some."""

    SOURCE = "source"
    MACHINE = "machine"


class AvoidWalls(StrEnum):
    """Whether travels go round outer walls."""

    AUTO = "auto"
    ALWAYS = "always"
    NEVER = "never"


class Cut(StrEnum):
    """Which contours may be cut so that several heads share them."""

    NONE = "none"
    INSIDE = "inside"
    ALL = "all"


class ProcessOrder(StrEnum):
    """Whether touching contours of different roles keep the slicer's order."""

    KEEP = "keep"
    FREE = "free"


def refuse_too_many_ahead(layers: int | None) -> None:
    """Raise InputError for a limit on the lead that no plan.json can hold; None: no limit."""
    if layers is not None and layers > MOST_LAYERS:
        raise InputError(
            f"max_layers_ahead is {layers}, must be at most {MOST_LAYERS}",
            advice="leave it out: then there is no limit",
        )


@dataclass(frozen=True, slots=True)
class Rules:
    """What is asked of every order besides safety.

    Parameters
    ----------
    process_order : ProcessOrder
        Whether touching contours of different roles keep the slicer's order.
    quality : bool | None
        Whether shells, and what is anchored in them, stay in the source's order; None: with
        every machine but the paper's.
    min_layer_time_s : float | None
        Least time before a spot is printed over, s, or the source's own time where that is
        less. None: the slicer's setting if `quality` holds, else no rule; 0: no rule.
    max_layers_ahead : int | None
        How many layers a part may run ahead of the rest; None: any number.
    freedom : Freedom
        Which traversals of a contour may be chosen.
    seam : Seam
        Where loops may begin, with freedom `SEAM`.
    avoid_walls : AvoidWalls
        Whether one head's travels go round outer walls through the part. `AUTO`: as far as it
        takes to lead over them no more than the source does.
    without_tower : bool
        Whether heads with one tool each leave out the wipe tower, which a slicer prints for
        changes of tools that do not happen then.

    Raises
    ------
    InputError
        For a limit below zero, one on layers beyond what plan.json holds, a name that is none, or
        a seam policy without the freedom it needs.

    Examples
    --------
    >>> from decmcts import Freedom, Rules, Seam
    >>> Rules(freedom=Freedom.SEAM, seam=Seam.REAR).max_layers_ahead is None
    True
    >>> Rules(seam=Seam.REAR)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    decmcts.errors.InputError: seam rear needs freedom seam, this is freedom reversible; ...
    """

    process_order: ProcessOrder = ProcessOrder.KEEP
    quality: bool | None = None
    min_layer_time_s: float | None = None
    max_layers_ahead: int | None = None
    freedom: Freedom = Freedom.REVERSIBLE
    seam: Seam = Seam.NEAREST
    avoid_walls: AvoidWalls = AvoidWalls.AUTO
    without_tower: bool = False

    def __post_init__(self) -> None:
        check_fields(self)
        refuse_too_many_ahead(self.max_layers_ahead)
        if self.seam != Seam.NEAREST and self.freedom != Freedom.SEAM:
            raise InputError(
                f"seam {self.seam} needs freedom seam, this is freedom {self.freedom}",
                advice="add --freedom seam, or leave --seam out",
            )

    def holds(self, machine: Machine) -> bool:
        """Tell whether `quality` holds on this machine: the paper's has no such rule."""
        return machine.bead_width if self.quality is None else self.quality

    def rule_s(self, job: PrintJob, machine: Machine) -> float:
        """Return the least time before a spot is printed over, s; 0: no rule."""
        if self.min_layer_time_s is not None:
            return self.min_layer_time_s
        return job.settings.min_layer_time_s if self.holds(machine) else 0.0

    def on(self, machine: Machine) -> OrderRules:
        """Return the rules as a plan for this machine states them."""
        return OrderRules(
            self.process_order.value, self.holds(machine), self.max_layers_ahead, self.freedom.value
        )


@dataclass(frozen=True, slots=True)
class Search:
    """How to search for an order for one head.

    Parameters
    ----------
    time_limit_s : float
        Wall-clock limit of the search, s; 0 ends it at once.
    seed : int
        Equal seeds and equal `max_iterations` give equal orders.
    planner : PlannerName | Planner
        One that comes with the program, or one of your own.
    objective : Objective
        What is minimised.
    max_iterations : int | None
        Limit on the planner's own iterations; None: time alone ends the search.
    certificate : bool
        Whether to prove how far from optimal the result is at most.

    Raises
    ------
    InputError
        For a limit or a seed below zero, or a name that is none.

    Examples
    --------
    >>> from decmcts import Search
    >>> Search(time_limit_s=5.0).planner.value
    'hybrid'
    """

    time_limit_s: float = 30.0
    seed: int = 0
    planner: PlannerName | Planner = PlannerName.HYBRID
    objective: Objective = Objective.TRAVEL
    max_iterations: int | None = None
    certificate: bool = True

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """What files and summaries call the planner."""
        planner = self.planner
        return planner.value if isinstance(planner, PlannerName) else type(planner).__name__.lower()

    @property
    def unit(self) -> str:
        """Unit of what is minimised, mm or s."""
        return "s" if self.objective == Objective.TIME else "mm"


@dataclass(frozen=True, slots=True)
class TeamSearch:
    """How several heads search for a joint plan.

    Parameters
    ----------
    time_limit_s : float
        Wall-clock limit of the heads' search, s.
    seed : int
        Equal seeds and equal messages give equal plans.
    objective : Objective
        What the order for one head alone minimises, and the choice of where loops are entered.
        The heads' search itself minimises the makespan.
    parameters : Mapping[str, float]
        Parameters of the heads' search to change, by name (docs/team.md).
    cut : Cut
        Which contours may be cut so that heads share them: none, those inside (infill and inner
        walls), or all. They are cut only where that ends the print sooner.
    weld_limit_s : float | None
        The most seconds between the printing of a cut's two ends; None: no limit. Contours that
        the sweep welds later stay whole, and where the heads' search ends later welds the sweep
        is printed.
    planner : TeamPlanner | None
        One of your own, which searches in this process; None: Dec-MCTS, a process for each head.
    stagger_mm : float
        By which cuts move from layer to layer (one way, not at all, the other way, in turn), at
        most `MOST_STAGGER_MM`. So joints interlock. With 0 all lie above one another.

    Raises
    ------
    InputError
        For a limit or a seed below zero, a name that is none, or a parameter out of its range.

    Examples
    --------
    >>> from decmcts import TeamSearch
    >>> TeamSearch(time_limit_s=10.0, parameters={"gamma": 0.95}).seed
    0
    """

    time_limit_s: float = 30.0
    seed: int = 0
    objective: Objective = Objective.TRAVEL
    parameters: Mapping[str, float] = field(default_factory=dict)
    cut: Cut = Cut.INSIDE
    weld_limit_s: float | None = None
    planner: TeamPlanner | None = None
    stagger_mm: float = STAGGER_MM

    def __post_init__(self) -> None:
        check_fields(self)
        if self.stagger_mm > MOST_STAGGER_MM:
            raise InputError(
                f"stagger_mm is {self.stagger_mm:g}, must be at most {MOST_STAGGER_MM:g}"
            )
        if self.parameters:
            from decmcts.team.dec_mcts.parameters import Parameters, changed  # loads much

            changed(Parameters(), self.parameters)

    @property
    def name(self) -> str:
        """What files and summaries call the planner."""
        return "dec-mcts" if self.planner is None else type(self.planner).__name__.lower()


@dataclass(frozen=True, slots=True)
class Held:
    """The rules a plan is held to; None: as the plan states.

    Parameters
    ----------
    process_order, quality, max_layers_ahead, freedom, min_layer_time_s
        As in `decmcts.Rules`.

    Raises
    ------
    InputError
        For a limit below zero or beyond what plan.json holds, or a name that is none.

    Examples
    --------
    >>> from decmcts import Held
    >>> Held(quality=True).names()
    ['quality']
    """

    process_order: ProcessOrder | None = None
    quality: bool | None = None
    max_layers_ahead: int | None = None
    freedom: Freedom | None = None
    min_layer_time_s: float | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        refuse_too_many_ahead(self.max_layers_ahead)

    def names(self) -> list[str]:
        """Return the names of the rules that are not None."""
        return [name for name in self.__slots__ if getattr(self, name) is not None]

    @property
    def any_rule(self) -> bool:
        """Whether any of them is a rule of the order; the layer time is not."""
        return bool(set(self.names()) - {"min_layer_time_s"})

    def over(self, rules: OrderRules) -> OrderRules:
        """Return `rules` with those that are not None here in their place."""
        named = {name: getattr(self, name) for name in self.names() if name != "min_layer_time_s"}
        return replace(rules, **named)


RULES = Rules()
NO_QUALITY = Rules(quality=False, min_layer_time_s=0.0)  # as in the literature
SEARCH = Search()
TEAM_SEARCH = TeamSearch()
AS_STATED = Held()
