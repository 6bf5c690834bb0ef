"""A print out of reach is refused with a place where it can be printed."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine
from decmcts.planning.problem.print_problem import load
from tests.prints import four_parts


@pytest.mark.parametrize("heads", [1, 2])
def test_a_print_out_of_reach_is_told_where_it_fits(tmp_path: Path, heads: int) -> None:
    """Moved there it can be planned; where nothing fits no place is named."""
    machine = load_machine("dual-gantry")
    kept = [replace(head, reach_max=(240.0, 300.0, 100.0)) for head in machine.heads[:heads]]
    short, path = machine.of_heads(kept), four_parts(tmp_path)
    with pytest.raises(InputError, match="no head reaches it; move the print by") as refused:
        load(path, short)
    x, y = map(float, re.findall(r"[xy] ([+-]?\d+)", refused.value.advice))
    assert x < 0.0 and "into reach" not in refused.value.advice
    text = re.sub(
        r"X([\d.]+)", lambda m: f"X{float(m[1]) + x}", path.read_text().partition("G28")[2]
    )
    text = re.sub(r"Y([\d.]+)", lambda m: f"Y{float(m[1]) + y}", text)
    path.write_text(path.read_text().partition("G28")[0] + "G28" + text)
    load(path, short)
    narrow = short.of_heads([replace(h, reach_max=(100.0, 100.0, 100.0)) for h in short.heads])
    with pytest.raises(
        InputError, match="no head reaches it; move the print into reach, or choose"
    ):
        load(path, narrow)
