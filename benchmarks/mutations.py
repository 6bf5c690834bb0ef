"""Good results, spoilt on purpose: what the judge makes of each kind of fault.

    python benchmarks/mutations.py [--seeds 0,1,2] [--of plan,team,gcode]

A small print made by code is planned for one head (`plan`, `gcode`) and for two
(`team`, `heads`), and so are one of two tools (`tools`, `head_tools`) and one with dots and
vertical beads (`dots`, `head_dots`); parts printed one by one, too near each other, for one head
(`safe`); and parts of two colours, whose result has fewer changes of tools (`changes`). Each
mutant is made once a seed and given to `decmcts verify` with the source and the machine. Writes
mutations.csv (resumable) and mutations.md in docs/results; exits with
1 if a mutant is missed or the judge crashes.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import io
import json
import resource
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from common import RESULTS, Rows, grouped, markdown, names, seeds, setting

from decmcts.cli.run import run
from decmcts.errors import InputError
from decmcts.experiments.made_print import made_gcode
from decmcts.formats.plans.plan_json import read_plan
from decmcts.planning.verify import digest_of
from tests.makers.changes import two_colours
from tests.makers.dots import made_dots_gcode
from tests.makers.scarf import scarf_gcode
from tests.makers.two_tools import made_tools_gcode
from tests.mutants.catalogue import Mutant, NotHereError
from tests.mutants.contacts import CONTACT_MUTANTS
from tests.mutants.dots import DOT_MUTANTS, HEAD_DOT_MUTANTS
from tests.mutants.gcode import GCODE_MUTANTS
from tests.mutants.heads import HEAD_MUTANTS
from tests.mutants.order import SAFE_MUTANTS, TEMPERATURE_MUTANTS, made_unsafe
from tests.mutants.plan import PLAN_MUTANTS, as_text
from tests.mutants.tools import CHANGE_MUTANTS, HEAD_TOOL_MUTANTS, TOOL_MUTANTS

KEY = ("of", "mutant", "seed")
ONE_HEAD, TWO_HEADS = "mk4s", "dual-gantry"
VERDICTS = {0: "passed", 1: "caught", 2: "refused"}  # by exit code; any other: crashed
MEMORY_BYTES = 6 * 2**30  # address space: a judge that wants more has run away
ALL = (
    "plan", "gcode", "tools", "dots", "safe", "contacts", "team", "heads", "head_tools",
    "head_dots", "changes",
)  # fmt: skip
OF_FILES: dict[str, tuple[Mutant[Any], ...]] = {
    "gcode": GCODE_MUTANTS + TEMPERATURE_MUTANTS, "tools": TOOL_MUTANTS, "dots": DOT_MUTANTS,
    "safe": SAFE_MUTANTS, "heads": HEAD_MUTANTS,
    "head_tools": HEAD_TOOL_MUTANTS, "head_dots": HEAD_DOT_MUTANTS,
    "changes": CHANGE_MUTANTS,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Subject:
    """A good result of one kind, and how it is read, spoilt, kept and judged."""

    mutants: tuple[Mutant[Any], ...]
    good: Any
    save: Callable[[Any, Path], list[str]]  # returns what `decmcts verify` is given


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=seeds, default=[0, 1, 2], help="SEED,SEED,…")
    parser.add_argument("--of", type=names, default=list(ALL), help=",".join(ALL))
    parser.add_argument("--mutants", default="", help="only those with this in their name")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder that is written")
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    rows = Rows(options.results / "mutations.csv", KEY)
    with tempfile.TemporaryDirectory() as folder:
        for kind in options.of:
            subject = subject_of(kind, Path(folder))
            require_sound(kind, subject, Path(folder))
            for mutant in subject.mutants:
                for seed in options.seeds if options.mutants in mutant.name else ():
                    if not rows.has(of=kind, mutant=mutant.name, seed=seed):
                        rows.append(judged(kind, subject, mutant, seed, Path(folder)))
                        print(*rows.rows[-1].values(), sep=" | ", flush=True)
    (options.results / "mutations.md").write_text(page(rows))
    return int(any(row["verdict"] in ("missed", "crashed") for row in rows.rows))


def subject_of(kind: str, folder: Path) -> Subject:
    """Plan the made print for one head or two and return what of it is spoilt.

    Of contacts it is the made source with scarf seams, which is a good result of itself.
    """
    if kind == "contacts":
        source = folder / "scarf.gcode"
        source.write_text(scarf_gcode([(60.0, 100.0), (140.0, 100.0)]))
        against = ["--source", str(source), "--machine", ONE_HEAD]
        return Subject(CONTACT_MUTANTS, source.read_text().splitlines(), gcode_saver(against))
    several = kind == "team" or "head" in kind
    made = {"plan": "gcode", "team": "heads"}.get(kind, kind)
    machine = TWO_HEADS if several else ONE_HEAD
    if kind == "head_tools":
        machine = str(tools_apart(folder / "machine.toml"))
    source, plan, out = (folder / f"{made}.{end}" for end in ("in.gcode", "json", "out.gcode"))
    against = ["--source", str(source), "--machine", machine]
    if not plan.exists():
        source.write_text(source_of(made))
        command, target = ("launch", folder / made) if several else ("plan", out)
        longer = ["--allow-slower"] if kind == "safe" else []
        require(["--time-limit", "3", "--plan", str(plan), "-o", str(target), *longer],
                command, source, machine)  # fmt: skip
    if kind in ("plan", "team"):
        return Subject(PLAN_MUTANTS, json.loads(plan.read_text()), plan_saver(against))
    if not several:
        return Subject(OF_FILES[kind], out.read_text().splitlines(), gcode_saver(against))
    heads = sorted(folder.glob(f"{made}_*.gcode"))
    texts = [path.read_text().splitlines() for path in heads]
    return Subject(OF_FILES[kind], texts, heads_saver([h.name for h in heads], plan, against))


def source_of(made: str) -> str:
    """Return the print made for files of a kind."""
    if made in ("tools", "head_tools"):
        return made_tools_gcode(macro=made == "tools")
    if made == "changes":
        return two_colours(layers=6)
    if made == "safe":
        return made_unsafe()
    if made in ("dots", "head_dots"):
        return made_dots_gcode((30, 150) if made == "dots" else (30, 240))
    return made_gcode([(60.0, 150.0), (240.0, 150.0)] if made == "heads"
                      else [(60.0, 100.0), (200.0, 100.0)])  # fmt: skip


def tools_apart(path: Path) -> Path:
    """Write the machine of two heads with one tool for each."""
    preset = files("decmcts") / "machines" / f"{TWO_HEADS}.toml"
    begin, *heads = preset.read_text().split("[[heads]]\n")
    with_tools = [f"[[heads]]\ntools = [{k}]\n{text}" for k, text in enumerate(heads)]
    path.write_text(begin + "".join(with_tools))
    return path


def require(options: list[str], command: str, source: Path, machine: str) -> None:
    """Run `plan` or `launch`; stops the benchmark if that fails."""
    code, said = quietly([command, str(source), "--machine", machine, *options])
    if code:
        sys.exit(f"{command} of the made print: exit {code}: {said}")


def require_sound(kind: str, subject: Subject, folder: Path) -> None:
    """Have the good result judged; one that does not pass would prove nothing of its mutants."""
    with tempfile.TemporaryDirectory(dir=folder) as place:
        code, said = quietly(["verify", *subject.save(subject.good, Path(place))])
    if code:
        sys.exit(f"the good result of {kind} does not pass: exit {code}: {said}")


def plan_saver(against: list[str]) -> Callable[[Any, Path], list[str]]:
    def save(good: Any, folder: Path) -> list[str]:
        path = folder / "plan.json"
        path.write_text(as_text(good))
        return [str(path), *against]

    return save


def gcode_saver(against: list[str]) -> Callable[[Any, Path], list[str]]:
    def save(good: Any, folder: Path) -> list[str]:
        path = folder / "out.gcode"
        path.write_text("\n".join(good) + "\n")
        return [str(path), *against]

    return save


def heads_saver(
    file_names: list[str], plan: Path, against: list[str]
) -> Callable[[Any, Path], list[str]]:
    def save(good: Any, folder: Path) -> list[str]:
        for name, lines in zip(file_names, good, strict=True):
            (folder / name).write_text("\n".join(lines) + "\n")
        return [*(str(folder / name) for name in file_names), "--plan", str(plan), *against]

    return save


def judged(
    kind: str, subject: Subject, mutant: Mutant[Any], seed: int, folder: Path
) -> dict[str, Any]:
    """Spoil a copy of the good result and have it judged; returns a row of the table."""
    row = {"of": kind, "mutant": mutant.name, "seed": seed, "verdict": "", "said": "", "error": ""}
    spoilt = copy.deepcopy(subject.good)
    try:
        mutant.spoil(spoilt, np.random.default_rng(seed))
    except NotHereError:
        return {**row, "verdict": "no place"}
    if mutant.sealed:
        seal(spoilt, folder)
    with tempfile.TemporaryDirectory(dir=folder) as place:
        code, said = quietly(["verify", *subject.save(spoilt, Path(place)), "--trials", "1"])
        said = said.replace(f"{place}/", "").replace(f"{folder}/", "")
    verdict = VERDICTS.get(code, "crashed")
    if verdict == "passed":
        verdict = "harmless" if mutant.harmless else "missed"
    return {**row, "verdict": verdict, "said": said[:200]}


def seal(plan: dict[str, Any], folder: Path) -> None:
    """Make the digest of a plan fit what it now says."""
    path = folder / "sealed.json"
    path.write_text(as_text(plan))
    with contextlib.suppress(InputError):  # then the judge will refuse it as well
        plan["problem"] = digest_of(read_plan(path))


def quietly(arguments: list[str]) -> tuple[int, str]:
    """Run a command of ours in this process; returns its exit code and its first line."""
    with captured() as text:
        code = run(arguments)
    lines = [line for line in text.getvalue().splitlines() if line.strip()]
    fitting = [line for line in lines if ": " in line]
    return code, (fitting or lines or ["nothing"])[0].strip()


@contextlib.contextmanager
def captured() -> Iterator[io.StringIO]:
    """Keep what is printed, on either stream."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.redirect_stderr(text):
        yield text


def page(rows: Rows) -> str:
    """Return the Markdown page of all rows."""
    why: dict[str, str] = {}
    every: tuple[tuple[Mutant[Any], ...], ...]
    every = (PLAN_MUTANTS, CONTACT_MUTANTS, *OF_FILES.values())
    for mutants in every:
        why |= {mutant.name: mutant.harmless for mutant in mutants}
    table, count = [], dict.fromkeys(("caught", "refused", "harmless", "missed", "crashed"), 0)
    for (kind, mutant), runs in grouped(rows.rows, "of", "mutant").items():
        made = [run for run in runs if run["verdict"] != "no place"]
        for one in made:
            count[one["verdict"]] += 1
        if made:
            told = ", ".join(sorted({one["verdict"] for one in made}))
            reason = why.get(mutant, "") if "harmless" in told else made[0]["said"]
            table.append([kind, mutant, str(len(made)), told, reason.replace("|", "/")])
    total = ", ".join(f"{n} {word}" for word, n in count.items())
    return (
        "# Mutants: what the judge makes of spoilt results\n\n"
        f"{setting(one_head=ONE_HEAD, two_heads=TWO_HEADS)}\n\n"
        "Repeat: `python benchmarks/mutations.py`. A print made by code is planned, spoilt in one "
        "way, and given to `decmcts verify` with its source and machine. Caught: faults are "
        "named, exit code 1. Refused: it can not be read, exit code 2. Harmless: it passes, for "
        "the reason given.\n\n"
        f"{len(table)} kinds, {sum(count.values())} mutants: {total}.\n\n"
        + markdown(table, ["of", "mutant", "made", "verdict", "first line, or why harmless"])
    )


if __name__ == "__main__":
    sys.exit(main())
