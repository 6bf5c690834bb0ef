"""A problem pack keeps every bit: agents compute the same digest from it."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from agents.planners.pack import Pack, load_source, read_pack, write_pack
from decmcts.errors import InputError
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.contours import Contours
from decmcts.print.job import Barrier, PrintJob, ProcessSettings
from decmcts.team.engine.plans import StatedOrder


def contours() -> Contours:
    points = np.array([[0.1, 0.2, 0.3], [1 / 3, 2 / 3, 0.3], [5, 5, 0.6], [6, 5, 0.6], [5, 5, 0.6]])
    return Contours(
        points=points,
        offsets=np.array([0, 2, 5]),
        extrusion=np.array([0, 0.1, 0, 0.2, 0.2]),
        feed=np.array([0, 30.0, 0, 40.0, 40.0]),
        width=np.array([0.45, 0.4]),
        height=np.array([0.3, 0.3]),
        role=np.array([1, 4], np.int8),
        closed=np.array([False, True]),
        layer=np.array([0, 1], np.int32),
        tool=np.array([0, 1], np.int16),
        reversible=np.array([True, False]),
        epoch=np.array([0, 1], np.int32),
        line=np.array([7, 9], np.int32),
    )


def test_a_pack_comes_back_equal(tmp_path: Path) -> None:
    """A lost bit would be another problem, and every agent would refuse it."""
    settings = ProcessSettings(travel_feed=1 / 3, hop_mm=0.2)
    barriers = (Barrier("M600", 12, "unknown command"),)
    job = PrintJob(
        "two", contours(), settings, barriers, "PrusaSlicer 2.5.0", ("note",), refills=(1,)
    )
    graph = DependencyGraph.from_pairs(2, np.array([[0, 1]], np.int32))
    machine = load_machine("dual-gantry")
    start = StatedOrder(np.array([1, 0], np.int32), np.array([True, False]), np.array([0, 1]))
    write_pack(Pack(job, machine, graph, {"share": 0.5}, start=start), tmp_path)
    back = read_pack(tmp_path)
    for f in fields(Contours):
        ours, read = getattr(job.contours, f.name), getattr(back.job.contours, f.name)
        if ours is None:
            assert read is None, f.name  # nothing is cut
            continue
        assert ours.dtype == read.dtype and ours.tobytes() == read.tobytes(), f.name
    assert back.job.settings == settings
    assert back.job.barriers == barriers
    assert back.job.refills == (1,)
    assert (back.job.name, back.job.slicer, back.job.notes) == (job.name, job.slicer, job.notes)
    assert back.graph.pairs().tolist() == [[0, 1]]
    assert [h.name for h in back.machine.heads] == [h.name for h in machine.heads]
    assert back.machine.rails == machine.rails
    assert back.parameters == {"share": 0.5}
    assert back.start is not None
    for f in fields(StatedOrder):
        assert getattr(back.start, f.name).tolist() == getattr(start, f.name).tolist()


@pytest.mark.parametrize("kept", [b"{}", b"PK\x03\x04"], ids=["other", "broken off"])
@pytest.mark.parametrize("spoil", ["", "problem.npz", "problem.json"])
def test_a_missing_or_broken_pack_is_one_clear_error(
    tmp_path: Path, spoil: str, kept: bytes
) -> None:
    """An agent started by hand may be pointed anywhere."""
    if spoil:
        job = PrintJob("two", contours())
        graph = DependencyGraph.from_pairs(2, np.zeros((0, 2), np.int32))
        write_pack(Pack(job, load_machine("paper"), graph), tmp_path)
        (tmp_path / spoil).write_bytes(kept)
    with pytest.raises(InputError, match="no problem pack"):
        read_pack(tmp_path)


def test_an_agent_takes_no_mesh(tmp_path: Path) -> None:
    """Each would slice it for itself, and their prints might differ."""
    (tmp_path / "part.stl").write_bytes(b"solid\nendsolid\n")
    with pytest.raises(InputError, match=r"part\.stl: an agent takes no mesh; slice it"):
        load_source(tmp_path / "part.stl", "dual-gantry", "keep")
