"""The notebook: it runs from top to bottom, and what is kept of it is small."""

from __future__ import annotations

import os
import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from examples import measure_head

TOUR = Path(measure_head.__file__).parent / "tour.ipynb"
LARGEST_BYTES = 300_000  # pictures and all
LIMIT = re.compile(r"(?<=time_limit_s=)[\d.]+")


@pytest.mark.long
@pytest.mark.filterwarnings("default")  # what a kernel's client warns of is not ours
def test_the_tour_runs() -> None:
    """In a kernel of its own, as a reader runs it but sooner; a cell that fails ends the test."""
    tour = nbformat.read(TOUR, as_version=4)
    for cell in tour.cells:
        cell.source = LIMIT.sub("0.3", cell.source)
    root = str(TOUR.parents[1])
    paths = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    client = NotebookClient(tour, timeout=300, resources={"metadata": {"path": root}})
    client.execute(env={**os.environ, "PYTHONPATH": paths})
    assert any("image/png" in output.get("data", {}) for output in outputs_of(tour))


def test_what_is_kept_is_small_and_whole() -> None:
    """Readers see the results on the web without running anything."""
    assert TOUR.stat().st_size < LARGEST_BYTES
    tour = nbformat.read(TOUR, as_version=4)
    nbformat.validate(tour)
    counts = [cell.execution_count for cell in tour.cells if cell.cell_type == "code"]
    assert counts == list(range(1, len(counts) + 1))
    assert not [output for output in outputs_of(tour) if output.output_type == "error"]


def outputs_of(tour: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """Return the outputs of all cells."""
    return [output for cell in tour.cells for output in cell.get("outputs", [])]
