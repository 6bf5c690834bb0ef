"""The measured head of the docs: what stands there must be what the program reads."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from decmcts.formats.machines.machine_file import load_machine
from examples import measure_head

PAGE = measure_head.FOLDER / "measure-your-head.md"
BED = 'name = "boxes"\nbed = { min = [0, 0], max = [220, 220] }\n'


def blocks() -> list[str]:
    return re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.S)


def test_the_page_shows_the_file_of_the_example(tmp_path: Path):
    """Readers copy what they see."""
    (tmp_path / "m.toml").write_text(blocks()[0])
    shown = load_machine(str(tmp_path / "m.toml"))
    file = load_machine(str(measure_head.MACHINE))
    assert [part.height_mm for part in shown.heads[0].slices] == [0.0, 5.0, 22.0]
    assert (shown.name, shown.bed_max) == (file.name, file.bed_max)


def test_the_boxes_of_the_page_are_the_head_that_is_drawn(tmp_path: Path):
    """Each part of the picture has its rectangle at its own height."""
    (tmp_path / "m.toml").write_text(BED + blocks()[1])
    slices = load_machine(str(tmp_path / "m.toml")).heads[0].slices
    by_height = {part.height_mm: part.polygons[0] for part in slices}
    for (left, right), (near, far), (low, _), _ in measure_head.PARTS.values():
        box = by_height[float(low)]
        assert (box[:, 1].min(), box[:, 1].max()) == (near, far)
        assert box[:, 0].min() <= left
        assert box[:, 0].max() >= right


@pytest.mark.slow
def test_the_pictures_of_the_page_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Those in the page are this script's; it must still run."""
    monkeypatch.setattr("sys.argv", ["measure_head", str(tmp_path)])
    measure_head.main()
    drawn = {path.name for path in tmp_path.iterdir()}
    assert drawn == set(re.findall(r"\]\((measure-\w+\.png)\)", PAGE.read_text()))
