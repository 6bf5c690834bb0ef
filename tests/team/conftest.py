"""Small random prints for two heads on a rail, and the partial order done slowly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from decmcts.feasibility.build import build_graph
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.machine import Head, Machine, Rail, Slice
from decmcts.print.plan import JointPlan
from tests.makers.random_machines import contours_of

SEPARATION = 24.0


def _box(half: float) -> np.ndarray:
    return np.array([[-half, -half], [half, -half], [half, half], [-half, half]])


def make_machine() -> Machine:
    """Two heads over a 120 mm bed, 24 mm apart; tall things block them."""
    slices = (Slice(0.0, (_box(2.0),)), Slice(1.0, (_box(8.0),)))
    reach = {"reach_min": (0.0, 0.0, 0.0), "reach_max": (110.0, 60.0, 50.0)}
    right = {"reach_min": (10.0, 0.0, 0.0), "reach_max": (120.0, 60.0, 50.0)}
    return Machine(
        "pair",
        (0.0, 0.0),
        (120.0, 60.0),
        (
            Head("left", slices, park=(-20.0, 30.0, 5.0), **reach),
            Head("right", slices, park=(140.0, 30.0, 5.0), **right),
        ),
        rails=(Rail(0, ("left", "right"), SEPARATION),),
        rest_s=0.0,
    )


def make_contours(polylines: list[np.ndarray], layers: list[int]) -> Contours:
    """Contours of these polylines; all else is plain."""
    return contours_of(polylines, layers, height=0.5)


def make_job(seed: int, towers: int = 6, layers: int = 4, reach: float = 6.0) -> PrintJob:
    """Towers at random places: on each layer a closed loop, then an infill stroke."""
    rng = np.random.default_rng(seed)
    centres = np.stack([rng.uniform(20, 100, towers), rng.uniform(12, 48, towers)], axis=1)
    sizes = rng.uniform(1.5, reach, towers)
    lines: list[np.ndarray] = []
    numbers: list[int] = []
    for layer in range(layers):
        for (x, y), size in zip(centres, sizes, strict=True):
            z = 0.5 * (layer + 1)
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * size
            lines.append(np.column_stack([corners + np.array([x, y]), np.full(5, z)]))
            stroke = np.array([[-0.5, -0.5], [0.5, 0.5]]) * size
            lines.append(np.column_stack([stroke + np.array([x, y]), np.full(2, z)]))
            numbers += [layer, layer]
    settings = ProcessSettings(travel_feed=100.0, retract_mm=1.0)
    return PrintJob(f"towers {seed}", make_contours(lines, numbers), settings)


@dataclass(frozen=True)
class Case:
    """A print, its machine and its graph."""

    job: PrintJob
    machine: Machine
    graph: DependencyGraph


@pytest.fixture(scope="session")
def case() -> Callable[..., Case]:
    """Build the case of a seed."""

    def build(seed: int, **options: float) -> Case:
        machine, job = make_machine(), make_job(seed, **options)  # type: ignore[arg-type]
        graph = build_graph(job.contours, machine.heads, clearance_mm=machine.clearance_mm)
        return Case(job, machine, graph)

    return build


@pytest.fixture(scope="session")
def case_of() -> Callable[..., Case]:
    """Build the case of given polylines, in one layer each."""

    def build(*polylines: list[tuple[float, float, float]], machine: Machine | None = None) -> Case:
        lines = [np.array(line, np.float64) for line in polylines]
        job = PrintJob("given", make_contours(lines, [0] * len(lines)))
        chosen = machine or make_machine()
        graph = build_graph(job.contours, chosen.heads, clearance_mm=chosen.clearance_mm)
        return Case(job, chosen, graph)

    return build


Action = tuple[int, int]  # head, index


class Order:
    """What comes before what, by walking every path: the slow oracle of the partial order."""

    def __init__(self, plan: JointPlan) -> None:
        self.plan = plan
        self.actions = [(r, i) for r, head in enumerate(plan.heads) for i in range(len(head))]
        bit = {action: 1 << k for k, action in enumerate(self.actions)}
        direct = {
            (r, i): ([(r, i - 1)] if i else []) + plan.heads[r].after(i) for r, i in self.actions
        }
        self._bit = bit
        self._ancestors: dict[Action, int] = {}
        pending = set(self.actions)
        while pending:
            ready = [a for a in pending if all(p in self._ancestors for p in direct[a])]
            assert ready, "J4: the order has a cycle"
            for action in ready:
                mask = 0
                for before in direct[action]:
                    mask |= self._ancestors[before] | bit[before]
                self._ancestors[action] = mask
                pending.discard(action)

    def before(self, a: Action, b: Action) -> bool:
        """Whether a must have ended before b begins."""
        return bool(self._ancestors[b] & self._bit[a])


@pytest.fixture(scope="session")
def order_oracle() -> type[Order]:
    """The slow partial order."""
    return Order
