"""Cut plans with faults: random kinds at random places, each of which the judge must refuse.

    python benchmarks/cut_plans.py [--count 2000] [--seed 0] [--models gf_baseplate]

Slabs made by code (and models of the corpus, where named) are cut and planned for two heads.
Their plans and files are read back by a reader of this script's own first: every point and all
filament must be the source's. Then each is spoilt `count` times in all, and judged in this
process. A mutant that leaves a valid plan says so; every other one must be refused. Digests and
metrics are left out, so that none is refused for those alone. Writes docs/results/cut_plans.md
(with models cut_plans_models.md); exits with 1 if a mutant is missed or the judge crashes.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from common import RESULTS, markdown, names, setting
from cut_paths import differences
from mutations import quietly
from team_prints import plate_path

from decmcts.errors import InputError
from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.plans.plan_json import CUT_VERSION, read_plan
from decmcts.planning.verify import judge_heads, read_as_planned
from decmcts.print.job import PrintJob
from sim.verify import verify_plan
from tests.makers.slab import slab_gcode
from tests.mutants.catalogue import Mutant, NotHereError
from tests.mutants.cuts import CUT_MUTANTS
from tests.mutants.piece_lines import PIECE_LINE_MUTANTS
from tests.mutants.pieces import PIECE_MUTANTS
from tests.mutants.plan import as_text

MACHINE = "dual-gantry"
SLABS: dict[str, tuple[dict[str, Any], str]] = {  # what is made, and what may be cut
    "short slab, inside": ({"layers": 3, "pitch": 9.0}, "inside"),
    "short slab, all": ({"first": 2, "wide": 160.0, "layers": 4, "pitch": 8.0}, "all"),
    "slab, inside": ({}, "inside"),
    "slab, all": ({"first": 4, "wide": 180.0, "pitch": 9.0}, "all"),
}
SHORT_REACH_MM = 190.0  # of the left head, so that there are pieces it does not reach
WELD_SLACK_S = 1000.0  # over the oldest weld, to the limit that plans state
TRIES = 20  # places to be tried for one mutant
PLANS = (*CUT_MUTANTS, *PIECE_MUTANTS)
ALL: tuple[Mutant[Any], ...] = (*PLANS, *PIECE_LINE_MUTANTS)


@dataclass(frozen=True, slots=True)
class Subject:
    """A cut print that is planned, as text."""

    name: str
    source: Path
    job: PrintJob
    plan: str  # JSON
    heads: dict[str, list[str]]  # lines of each head's file, by its name


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=2000, help="mutants in all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--slabs", type=int, default=len(SLABS), help="of the slabs, the first N")
    parser.add_argument("--models", type=names, default=[], help="NAME,NAME,… of the corpus")
    parser.add_argument("--mutants", default="", help="only those with one of WORDS,WORDS,… in it")
    parser.add_argument("--time-limit", type=float, default=1.0, help="seconds a search")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder that is written")
    options = parser.parse_args()
    started, bad = time.perf_counter(), False
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        subjects = list(_subjects(options, folder))
        found: Counter[tuple[str, str]] = Counter()
        said: dict[str, str] = {}
        for kind, verdict, line in _judged(subjects, options, folder):
            found[kind, verdict] += 1
            if line and kind not in said:
                said[kind] = line
            if verdict in ("missed", "crashed", "refused though valid"):
                bad = True
                print(f"{verdict}: {kind}: {line}", flush=True)
    took = time.perf_counter() - started
    name = "cut_plans_models.md" if options.models else "cut_plans.md"
    (options.results / name).write_text(page(subjects, found, said, options, took))
    print(f"{sum(found.values())} mutants in {took:.0f} s: {_totals(found)}")
    return int(bad)


def _subjects(options: argparse.Namespace, folder: Path) -> list[Subject]:
    """Plan all prints; stops where a good result does not pass or differs from its source."""
    made = []
    machine = _machine(folder / "machine.toml")
    for name, (slab, cut) in list(SLABS.items())[: options.slabs]:
        source = folder / f"{name.replace(', ', '_').replace(' ', '_')}.gcode"
        source.write_text(slab_gcode(**slab))
        made.append(_subject(name, source, cut, machine, options.time_limit))
    for name, cut in product(options.models, ("inside", "all")):
        source = plate_path(name)
        copy = folder / f"{name}_{cut}.gcode.gz"
        copy.write_bytes(source.read_bytes())
        made.append(_subject(f"{name}, {cut}", copy, cut, MACHINE, options.time_limit))
    return made


def _machine(path: Path) -> str:
    """Write the machine with a left head that does not reach all."""
    text = (files("decmcts") / "machines" / f"{MACHINE}.toml").read_text()
    path.write_text(text.replace("max = [270, 300, 250]", f"max = [{SHORT_REACH_MM}, 300, 250]"))
    return str(path)


def _subject(name: str, source: Path, cut: str, machine: str, limit_s: float) -> Subject:
    stem = source.with_name(source.name.removesuffix(".gz").removesuffix(".gcode"))
    plan = stem.with_suffix(".json")
    command = ["launch", str(source), "--machine", machine, "--cut", cut, "-o", str(stem)]
    code, line = quietly([*command, "--time-limit", str(limit_s), "--plan", str(plan)])
    if code:
        sys.exit(f"launch of {name}: exit {code}: {line}")
    written = sorted(source.parent.glob(f"{stem.name}_*.gcode*"))
    if off := differences(source, written):
        sys.exit(f"{name}: the files differ from their source: {off[0]}")
    good = json.loads(plan.read_text())
    if good["version"] != CUT_VERSION:
        sys.exit(f"{name}: nothing was cut")
    good["rules"]["weld_limit_s"] = good["metrics"]["cut"]["weld_most_s"] + WELD_SLACK_S
    job, _ = read_gcode(source)
    heads = {path.name: load_text(path).decode().splitlines() for path in written}
    return Subject(name, source, job, json.dumps({**good, "metrics": {}}), heads)


def _judged(
    subjects: list[Subject], options: argparse.Namespace, folder: Path
) -> Iterator[tuple[str, str, str]]:
    """Yield the name of each mutant that could be made, what became of it and a line."""
    mutants = [m for m in ALL if any(word in m.name for word in options.mutants.split(","))]
    turns = list(product(mutants, subjects))
    made, tried, rng = 0, 0, np.random.default_rng(options.seed)
    while made < options.count and tried < TRIES * options.count:
        mutant, subject = turns[tried % len(turns)]
        tried += 1
        line = _try(subject, mutant, rng, folder)
        if line is not None:
            made += 1
            yield mutant.name, *_verdict(mutant, line)


def _verdict(mutant: Mutant[Any], line: str) -> tuple[str, str]:
    """Return what became of a mutant of which the judge said `line`; nothing: it passed."""
    if line.startswith("crashed"):
        return "crashed", line
    if mutant.harmless:
        return ("refused though valid", line) if line else ("valid", mutant.harmless)
    return ("refused", line) if line else ("missed", "")


def _try(
    subject: Subject, mutant: Mutant[Any], rng: np.random.Generator, folder: Path
) -> str | None:
    """Return the first fault that is found, nothing if there is none, None if it has no place."""
    path = folder / "plan.json"
    plan, lines = json.loads(subject.plan), {n: list(t) for n, t in subject.heads.items()}
    try:
        mutant.spoil(plan if mutant in PLANS else list(lines.values()), rng)
    except NotHereError:
        return None
    if plan == json.loads(subject.plan) and lines == subject.heads:
        return None  # a word was replaced by itself
    path.write_text(as_text(plan))
    try:
        if mutant in PLANS:
            faults = verify_plan(read_plan(path), source=subject.job, trials=1).faults
        else:
            for name, text in lines.items():
                (folder / name).write_text("\n".join(text) + "\n")
            paths = [folder / name for name in lines]
            document = read_plan(path)
            source = read_as_planned(document, subject.source, None)
            faults = judge_heads(paths, source, document).faults
    except InputError as error:
        return str(error).replace(f"{folder}/", "")
    except Exception:  # what a judge must never do, and is counted
        return f"crashed: {traceback.format_exc().splitlines()[-1]}"
    return str(faults[0]) if faults else ""


def _totals(found: Counter[tuple[str, str]]) -> str:
    count: Counter[str] = Counter()
    for (_, verdict), n in found.items():
        count[verdict] += n
    return ", ".join(f"{n} {verdict}" for verdict, n in count.most_common())


def page(
    subjects: list[Subject], found: Counter[tuple[str, str]], said: dict[str, str],
    options: argparse.Namespace, took_s: float,
) -> str:  # fmt: skip
    """Return the Markdown page."""
    kinds = {kind for kind, _ in found}
    prints = "; ".join(f"{s.name}: {len(json.loads(s.plan)['contours'])} pieces" for s in subjects)
    slabs = "" if options.slabs == len(SLABS) else f" --slabs {options.slabs}"
    models = f" --models {','.join(options.models)}" if options.models else ""
    table = [
        [kind, str(n), verdict, said.get(kind, "").replace("|", "/")[:160]]
        for (kind, verdict), n in sorted(found.items(), key=lambda item: item[0])
    ]
    return (
        "# Cut plans with faults\n\n"
        f"{setting(machine=MACHINE, seed=options.seed)}\n\n"
        f"Repeat: `python benchmarks/cut_plans.py --count {options.count}{slabs}{models}`. Plans "
        "and files of cut prints are spoilt at random places and judged, in the same process. "
        "Before that, both files of each print are read by a reader of the benchmark's own: each "
        "move that prints lies on a move of the source, all of it is covered once, and its "
        "filament is the source's to the last digit.\n\n"
        f"{prints}.\n\n"
        f"{len(kinds)} kinds, {sum(found.values())} mutants in {took_s:.0f} s: "
        f"{_totals(found)}.\n\n"
        + markdown(table, ["mutant", "made", "verdict", "what was found first, or why valid"])
    )


if __name__ == "__main__":
    sys.exit(main())
