"""The judge on real prints: good plans pass quickly, spoiled files do not."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from decmcts.feasibility.build import build_graph
from decmcts.formats.gcode import read_gcode, read_motions
from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.plan import OrderRules, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.team.schedule.joint_plan import schedule
from sim.faults import FaultKind as K
from sim.verify import verify_plan
from tests.makers.corpus import CORPUS
from tests.sim.files.motions import verify_motions

pytestmark = [pytest.mark.shared, pytest.mark.slow]


@pytest.fixture(params=["pillars_5x5", "pillars_4x4_tall", "benchy_lowpoly"])
def print_file(request) -> Path:
    path = CORPUS / "models" / "gcode" / f"{request.param}.gcode.gz"
    if not path.exists():
        pytest.skip(f"no corpus of real prints at {CORPUS}")
    return path


def depth_first(graph) -> np.ndarray:
    """A linear extension that climbs as long as it may: the hardest for the head."""
    waits = np.diff(graph.pred_offsets).copy()
    ready = [i for i in range(graph.n - 1, -1, -1) if waits[i] == 0]
    order = []
    while ready:
        a = ready.pop()
        order.append(a)
        for b in graph.succs[graph.succ_offsets[a] : graph.succ_offsets[a + 1]][::-1]:
            waits[b] -= 1
            if waits[b] == 0:
                ready.append(int(b))
    return np.array(order, np.int32)


def plan_of(job, machine, graph, order) -> PlanDocument:
    toolpath = Toolpath.of(order, np.zeros(len(order), np.bool_))
    plan = schedule(job, machine, graph, [toolpath])
    return PlanDocument("", machine, job.contours, graph.pairs(), plan, {})


@pytest.mark.parametrize("name", ["paper", "mk3s"])
def test_climbing_as_far_as_the_graph_allows_is_safe(print_file, name):
    """The planner's graph and the judge's geometry agree on real heads."""
    job, _ = read_gcode(print_file)
    machine = load_machine(name)
    graph = build_graph(job.contours, machine.heads, clearance_mm=machine.clearance_mm)
    document = plan_of(job, machine, graph, depth_first(graph))
    assert verify_plan(document, source=job, trials=1).faults == ()


def test_the_graph_of_a_smaller_head_is_not_safe(print_file):
    """Planned for a needle, judged with the real head: contacts, found by geometry alone."""
    job, _ = read_gcode(print_file)
    machine = load_machine("mk3s")
    needle = replace(machine.heads[0], slices=machine.heads[0].slices[:1])
    tip = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
    needle = replace(needle, slices=(replace(needle.slices[0], polygons=(tip,)),))
    thin = replace(machine, heads=(needle,))
    graph = build_graph(job.contours, thin.heads, clearance_mm=0.0)
    document = plan_of(job, thin, graph, depth_first(graph))
    document = replace(document, rules=OrderRules("free", quality=False))
    assert verify_plan(document, trials=0).ok
    assert verify_plan(replace(document, machine=machine), trials=0).kinds() == {K.HEAD_MATERIAL}


def test_a_source_passes_and_a_swapped_file_does_not(print_file):
    """Layers swapped in the file: every extrusion is there, the head would crash."""
    motions = read_motions(print_file)
    machine = load_machine("mk3s")
    assert verify_motions(motions, motions, machine).ok
    z = motions.points[1:, 2]
    layers = np.unique(z[motions.contour >= 0])
    low, high = (np.nonzero((motions.contour >= 0) & (z == layers[k]))[0] for k in (3, 9))
    cuts = (0, low[0], high[0], high[-1] + 1, len(z))
    parts = [np.arange(a, b) for a, b in pairwise(cuts)]
    order = np.concatenate([parts[0], parts[2], parts[1], parts[3]])
    # ends move along: a part begins with a jump from where the one before it ended
    points = np.vstack([motions.points[:1], motions.points[1:][order]])
    names = ("extrusion", "feed", "line", "contour", "width", "height")
    rest = {name: getattr(motions, name)[order] for name in names}
    spoiled = replace(motions, points=points, **rest)
    assert K.HEAD_MATERIAL in verify_motions(spoiled, motions, machine).kinds()
