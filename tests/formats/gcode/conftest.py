"""Small G-code files made here, and the corpus of real prints where present."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.formats.gcode import (
    GcodeDocument,
    read_gcode,
    write_gcode,
)
from decmcts.print.job import PrintJob
from decmcts.print.toolpath import Toolpath
from sim.content.seams import seams_of_plan
from tests.direct_actions import direct_actions
from tests.makers.corpus import CORPUS
from tests.makers.same_extrusions import same_extrusions, source_with
from tests.print.test_loops import random_entries

START = "G28\nG21\nG90\nM82\nG92 E0\n"
Read = Callable[..., tuple[PrintJob, GcodeDocument]]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Read a text, by default behind an absolute-E start and a first-layer mark."""

    def reader(text: str | bytes, *, start: str = START + ";LAYER_CHANGE\n;Z:0.2\n"):
        path = tmp_path / "in.gcode"
        raw = text if isinstance(text, bytes) else (start + text).encode()
        path.write_bytes(raw)
        return read_gcode(path)

    return reader


@pytest.fixture
def again(tmp_path: Path) -> Callable[..., tuple[PrintJob, GcodeDocument, bytes]]:
    """Write a job, read it again, and demand the same print.

    With a seed it is shuffled within epochs, with `seams` its loops begin anywhere.
    """

    def rewrite(
        job: PrintJob, document: GcodeDocument, *, seed: int | None = None, seams: bool = False
    ):
        out = tmp_path / "out.gcode"
        path = toolpath_of(job, seed)
        if seams:
            entry = random_entries(job.contours, seed or 0)[path.order]
            path = replace(path, entry=np.where(path.order > 0, entry, 0).astype(entry.dtype))
        actions = direct_actions(job, path)
        write_gcode(document, job, actions, out)
        job2, document2 = read_gcode(out)
        due = source_with(job, document, seams_of_plan(actions))
        assert same_extrusions(*due, job2, document2) == []
        assert len(job2.contours) == len(job.contours)
        return job2, document2, out.read_bytes()

    return rewrite


def toolpath_of(job: PrintJob, seed: int | None) -> Toolpath:
    """Return the source's order, or a random one that keeps epochs and fixed directions."""
    n = len(job.contours)
    if seed is None:
        return Toolpath.as_sliced(n)
    rng = np.random.default_rng(seed)
    later = np.arange(n) > 0  # what the start primes the nozzle for stays first
    order = np.lexsort((rng.random(n), later, job.contours.epoch)).astype(np.int32)
    turned = (rng.random(n) < 0.5) & job.contours.reversible[order]
    return Toolpath.of(order, turned & (order > 0))


@pytest.fixture
def needs_corpus() -> None:
    """Skip with a reason where the corpus is absent."""
    if not CORPUS.is_dir():
        pytest.skip("the corpus of real prints is absent (DECMCTS_CORPUS)")
