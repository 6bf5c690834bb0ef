"""Dots and vertical beads from file to file, for one head and for two, and spoilt on purpose."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from decmcts.cli.run import run
from decmcts.formats.gcode import read_gcode, read_motions

START = "G28\nG90\nM83\nG1 E-0.8 F2100\n"
LINES, FEET = (60, 85, 110), (160, 185)  # y, mm
PAID, PULLED = "G1 E0.8 F2100\n", "G1 E-0.8 F2100\n"
DOT, PILLAR, BEAD = r"^G1 E1\.50000 F100$", r"^G1 Z2\.300 E0\.40000", r"^G1 X\S+ Y\S+ E0\.6"


def at(x, y, z):
    return f"G0 Z3 F600\nG0 X{x} Y{y} F8000\nG0 Z{z} F600\n"


def plate(xs):
    """Lines, then dots above their level, then pillars that stand on lines."""
    lines = [
        f"{at(x, y, 0.3)}{PAID}G1 X{x + 15} E0.6 F1200\n{PULLED}" for x in xs for y in LINES + FEET
    ]
    dots = [f"{at(x + 5, y + 10, 0.6)}{PAID}G1 E1.5 F100\n{PULLED}" for y in LINES for x in xs]
    dots[1] = dots[1].replace(f"{PAID}G1 E1.5", "G1 E2.3")  # as one push
    pillars = [f"{at(x + 7, y, 0.3)}{PAID}G1 Z2.3 E0.4 F200\n{PULLED}" for x in xs for y in FEET]
    return START + "".join([*lines, *dots, *pillars]) + "M84\n"


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """A plate planned for one head: its source, and the file that was written."""
    folder = tmp_path_factory.mktemp("dots")
    source, out = folder / "in.gcode", folder / "out.gcode"
    source.write_text(plate((30, 150)))
    options = ["--machine", "mk4s", "--time-limit", "0.5", "--planner", "greedy", "--allow-slower"]
    assert run(["plan", str(source), "-o", str(out), *options]) == 0
    return source, out


def verified(out, source):
    return run(["verify", str(out), "--source", str(source), "--machine", "mk4s"])


@pytest.mark.slow
def test_what_goes_in_comes_out(planned):
    """Every dot and every pillar, with all its filament: they were lost and called verified."""
    source, out = planned
    text = out.read_text()
    assert len(re.findall(DOT, text, re.M)) == 6 and len(re.findall(PILLAR, text, re.M)) == 4
    pushed = [read_motions(path).extrusion.sum() for path in planned]
    assert pushed[0] == pytest.approx(pushed[1], abs=1e-4)
    assert verified(out, source) == 0


def spoilt(lines, pattern, how):
    k = [k for k, line in enumerate(lines) if re.search(pattern, line)][1]
    return [*lines[:k], *how(lines[k]), *lines[k + 1 :]]


MUTANTS = {
    "a dot dropped": (DOT, lambda line: []),
    "a dot doubled": (DOT, lambda line: [line, line]),
    "a dot moved": (DOT, lambda line: ["G1 X80 F9000", line]),
    "a dot a little higher": (DOT, lambda line: ["G1 Z0.700 F600", line]),
    "more filament in a dot": (DOT, lambda line: [line.replace("E1.5", "E1.7")]),
    "a dot at another feed": (DOT, lambda line: [line.replace("F100", "F200")]),
    "a dot made a restart": (DOT, lambda line: [line, "G1 E-1.50000 F100"]),
    "a pillar dropped": (PILLAR, lambda line: []),
    "a pillar without filament": (PILLAR, lambda line: [line.replace("E0.40000", "")]),
    "a pillar printed downward": (
        PILLAR, lambda line: ["G1 Z2.300 F600", "G1 Z0.300 E0.40000 F200"],
    ),
    "a pillar twice": (PILLAR, lambda line: [line, "G1 Z0.300", line]),
    "a pillar less high": (PILLAR, lambda line: [line.replace("Z2.300", "Z2.000")]),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", MUTANTS)
def test_spoilt_it_is_refused(planned, tmp_path, name):
    """The judge counts what is pushed on the spot and while the nozzle climbs by itself."""
    source, out = planned
    pattern, how = MUTANTS[name]
    other = tmp_path / "spoilt.gcode"
    other.write_text("\n".join(spoilt(out.read_text().splitlines(), pattern, how)) + "\n")
    assert verified(other, source) == 1


@pytest.mark.slow
def test_a_pillar_before_what_supports_it_is_refused(planned, tmp_path):
    """It stands on a line: printed first, the head would go through it for the line."""
    source, out = planned
    lines = out.read_text().splitlines()
    k = next(k for k, line in enumerate(lines) if re.search(PILLAR, line))
    begin = max(j for j in range(k) if lines[j].startswith("G1 X"))
    first = next(j for j, line in enumerate(lines) if re.search(BEAD, line))
    moved = [*lines[begin : k + 1], "G1 Z5.000 F600", lines[first - 3]]
    rest = [*lines[:begin], *lines[k + 1 :]]
    path = tmp_path / "spoilt.gcode"
    path.write_text("\n".join([*rest[: first - 1], *moved, *rest[first - 1 :]]) + "\n")
    assert verified(path, source) == 1


@pytest.mark.slow
def test_two_heads_share_dots_and_pillars(tmp_path):
    """A dot takes time where the head stands; the files keep it, and are judged with the plan."""
    source, stem, plan = tmp_path / "in.gcode", tmp_path / "out", tmp_path / "plan.json"
    source.write_text(plate((30, 240)))
    machine = ["--machine", "dual-gantry"]
    options = [*machine, "--time-limit", "1", "--plan", str(plan)]
    assert run(["launch", str(source), "-o", str(stem), *options]) == 0
    files = sorted(str(path) for path in tmp_path.glob("out_*.gcode"))
    texts = "".join(Path(path).read_text() for path in files)
    assert len(re.findall(DOT, texts, re.M)) == 6 and len(re.findall(PILLAR, texts, re.M)) == 4
    assert run(["verify", *files, "--source", str(source), "--plan", str(plan), *machine]) == 0
    assert run(["verify", *files, "--source", str(source), *machine]) == 0
    assert run(["verify", str(plan), "--source", str(source), *machine]) == 0
    assert len(read_gcode(source)[0].contours) == 20
    lines = Path(files[0]).read_text().splitlines()
    Path(files[0]).write_text("\n".join(spoilt(lines, DOT, lambda line: [])) + "\n")
    assert run(["verify", *files, "--source", str(source), "--plan", str(plan), *machine]) == 1
