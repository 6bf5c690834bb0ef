"""What each part of `hybrid` is worth: without it, and alone, at equal time.

    python benchmarks/ablation.py [--seeds 0,1,2] [--time-limit 10]
    python benchmarks/ablation.py --time-limit 60 --variants hybrid,twin,no-partition

One part is left out at a time. A twin is `hybrid` with another seed: what it differs by
is noise. `bare` is annealing of whole sequences on two threads, nothing else; on top of
it comes one part at a time. `local` is the planner of that name, on one thread.
Where a variant would do the same as `hybrid` it is not run: each is run at the sizes
where its part is at work.
Seconds are processor time of the search (`cpu_time.py`). Runs go seed by seed, in each
of them model by model, which is read once for all variants, so that a stopped benchmark
has whole rows of the table.
Writes docs/results/ablation.csv (a row a run, resumable), ablation.md, ablation.png.
"""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from common import CPU_TIME, Rows, arguments, grouped, markdown, names, of_models, setting
from cpu_time import WorkClock
from effects import Effect, against_twins, told
from in_process import less_percent, loaded, searched

from decmcts.search.decomposition import threads
from decmcts.search.decomposition.blocks import Sequence, crossover
from decmcts.search.hybrid import multistart, phases
from decmcts.search.hybrid.multistart import Multistart, Partition
from decmcts.search.hybrid.phases import Hybrid
from decmcts.search.hybrid.search import HybridSearch
from decmcts.search.sequence.planner import Planner
from decmcts.search.sequence.stopping import DESCENT_FROM

MODELS = (  # sizes in turn, so that a part of the runs has something of each
    "teaset_chess_7 mozc_arms_6 spiral_cup moveo_covers_4 odri_spacers_6 so100_plate_part1 "
    "quad_lower_leg_plate mozc_caps_top"
)
SIZES = {"to 1000": 1000, "to 6000": 6000, "larger": 10**9}  # contours
TWIN = 1000  # added to its seed


@dataclass(frozen=True, slots=True)
class NoPhase:
    """In the place of a phase that is left out."""

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Do nothing."""
        search.incumbent.tick()
        yield


HYBRID = Hybrid()
NO_PHASE: Any = NoPhase()
SEVERAL, NEVER = HYBRID.multistart, Multistart(always=0, at_most=0)
ALONE = Partition(for_windows=math.inf)
BARE = Hybrid(
    exact=NO_PHASE,
    layered=NO_PHASE,
    multistart=Multistart(always=10**9, until=DESCENT_FROM),
)
BARE_SEARCHED = replace(BARE, multistart=replace(BARE.multistart, until=SEVERAL.until))


def started(contours: int, limit_s: float) -> bool:
    """Tell whether `hybrid` anneals several starts, one a thread, in so much time."""
    enough = 1.5e6 * limit_s / SEVERAL.least
    return contours <= SEVERAL.always or contours <= min(SEVERAL.at_most, enough)


def parted(contours: int, limit_s: float) -> bool:
    return not started(contours, limit_s)


def layered(contours: int, limit_s: float) -> bool:
    return started(contours, limit_s) or contours >= HYBRID.partition.layers_from


def anywhere(contours: int, limit_s: float) -> bool:
    return True


@dataclass(frozen=True, slots=True)
class Variant:
    """A search, and where it is another one than `hybrid`."""

    says: str
    planner: str | Planner
    at_work: Callable[[int, float], bool] = anywhere  # of contours and seconds
    seams_only: bool = False
    chooses_entries: bool = True  # entries are chosen anew, all at once, when threads meet
    crosses: bool = True  # results of threads are crossed; else the best is taken


VARIANTS = {
    "hybrid": Variant("`hybrid`", HYBRID),
    "twin": Variant("its twin", HYBRID),
    "no-exact": Variant("without exact solutions", replace(HYBRID, exact=NO_PHASE)),
    "no-multistart": Variant(
        "without several starts: a partition", replace(HYBRID, multistart=NEVER), started
    ),
    "no-partition": Variant(
        "without partition: several starts",
        replace(HYBRID, multistart=Multistart(always=10**9)),
        parted,
    ),
    "no-pieces": Variant(
        "partition without pieces", replace(HYBRID, partition=Partition(blocks=(0, 0))), parted
    ),
    "no-windows": Variant(
        "without windows",
        replace(HYBRID, multistart=Multistart(until=DESCENT_FROM), partition=ALONE),
    ),
    "no-crossover": Variant("without crossover", HYBRID, crosses=False),
    "no-layers": Variant("without layered starts", replace(HYBRID, layered=NO_PHASE), layered),
    "no-settling": Variant(
        "entries by moves alone", HYBRID, seams_only=True, chooses_entries=False
    ),
    "one-thread": Variant("one thread", replace(HYBRID, threads=1)),
    "local": Variant("`local`", "local"),
    "bare": Variant("bare", BARE, crosses=False),
    "bare-exact": Variant(
        "bare, exact solutions", replace(BARE, exact=HYBRID.exact), crosses=False
    ),
    "bare-partition": Variant(
        "bare, partition", replace(BARE, multistart=NEVER, partition=ALONE), crosses=False
    ),
    "bare-windows": Variant("bare, windows", BARE_SEARCHED, crosses=False),
    "bare-crossover": Variant("bare, crossover", BARE),
    "bare-layers": Variant(
        "bare, layered starts", replace(BARE, layered=HYBRID.layered), crosses=False
    ),
}
EXPLAINED = """\
Figures are per cent of travel that a variant makes more than `hybrid`: above 0, what is left
out pays. `hybrid` is the mean of two runs, itself and its twin. After ± stands within what a
variant that changes nothing would mostly stay: two standard errors, from how far twins are
apart. Bold is what lies beyond. A variant is run only where it is another search than
`hybrid`. Where both solve a print exactly there is nothing to compare; such runs are left out
of the means. In these runs `hybrid` still annealed anew, after each round of several starts,
where the two best results differ (merging). Without it travel was the same, −0.01 ± 0.21 % in
16 runs, so that it is gone. So is tree search over clusters, with which travel was longer. They
also had a large neighbourhood search from 0.65 of the time on, and windows within it. Windows
alone, from 0.85 on, ended 0.13 % higher in the mean of ten pairs of runs (odri_spacers_6 0.31
with seams and 0.02 without, mozc_arms_6 0.31, teaset_chess_7 0.01, moveo_covers_4 −0.02 with
seams; two runs of the same search are up to 1.4 % apart), and 0.9 % lower in one pair of 30 s. So
windows alone are left.
"""
KEY = ("model", "machine", "process", "freedom", "variant", "limit_s", "seed")
ROW = ("machine", "freedom", "process", "model")


@contextmanager
def choosing_entries(wanted: bool) -> Iterator[None]:
    """Let sequences keep their entries when threads meet, within a `with`."""
    usual = Sequence.choose_entries
    if not wanted:
        Sequence.choose_entries = lambda self: None  # type: ignore[method-assign]  # no library option
    try:
        yield
    finally:
        Sequence.choose_entries = usual  # type: ignore[method-assign]


@contextmanager
def crossing(wanted: bool) -> Iterator[None]:
    """Let the best of sequences be taken in place of their crossover, within a `with`."""
    places = (threads, multistart, phases)
    for place in places if not wanted else ():
        place.crossover = best_of  # type: ignore[attr-defined]  # no library option
    try:
        yield
    finally:
        for place in places:
            place.crossover = crossover  # type: ignore[attr-defined]


def best_of(found: list[Sequence]) -> Sequence:
    """Return a copy of the cheapest."""
    return min(found, key=lambda sequence: sequence.cost).copy()


def run(key: dict[str, Any], variant: Variant) -> dict[str, Any]:
    with choosing_entries(variant.chooses_entries), crossing(variant.crosses):
        prepared, result = searched(
            key["model"], key["machine"], key["process"], key["freedom"], variant.planner,
            limit_s=key["limit_s"], seed=key["seed"] + (TWIN if key["variant"] == "twin" else 0),
            clock=WorkClock(),
        )  # fmt: skip
    return key | {
        "contours": len(prepared.job.contours),
        "travel_before_mm": result.source_cost,
        "travel_after_mm": result.cost,
        "less_percent": round(less_percent(result), 2),
        "proven": result.bound is not None,
        "iterations": result.iterations,
        "error": "",
    }


def run_all(rows: Rows, options: argparse.Namespace) -> None:
    """Make the runs that are not there yet, on the main thread: its time is the search's."""
    for seed, model, name in itertools.product(options.seeds, options.models, options.settings):
        machine, freedom = name.split("-")
        for variant in options.variants:
            chosen = VARIANTS[variant]
            key = dict(zip(KEY, (model, machine, options.process, freedom, variant,
                                 options.time_limit, seed), strict=True))  # fmt: skip
            if rows.has(**key) or (chosen.seams_only and freedom != "seam"):
                continue
            contours = len(loaded(model, machine, options.process).job.contours)
            if chosen.at_work(contours, options.time_limit):
                rows.append(run(key, chosen))
                print(*(f"{k}={v}" for k, v in rows.rows[-1].items()), flush=True)


def effects(rows: list[dict[str, str]]) -> dict[str, list[tuple[dict[str, str], Effect]]]:
    """Return each variant's effects, with a row each."""
    found: dict[str, list[tuple[dict[str, str], Effect]]] = {}
    for mine in grouped(rows, *ROW, "seed").values():
        travel = {row["variant"]: float(row["travel_after_mm"]) for row in mine}
        found_here = against_twins(travel, "hybrid")
        for row in mine:
            if row["variant"] in found_here:
                found.setdefault(row["variant"], []).append((row, found_here[row["variant"]]))
    return {name: found[name] for name in VARIANTS if name in found}


def size_of(row: dict[str, str]) -> str:
    return next(name for name, most in SIZES.items() if int(row["contours"]) <= most)


def summary(found: dict[str, list[tuple[dict[str, str], Effect]]]) -> str:
    """Return the table of mean effects by setting and size; bold what is beyond noise."""
    settings = list(
        dict.fromkeys((r["machine"], r["freedom"]) for runs in found.values() for r, _ in runs)
    )
    lines = []
    for name, runs in found.items():
        if name in ("hybrid", "twin"):
            continue
        runs = [(r, e) for r, e in runs if name.startswith("bare") or r["proven"] != "True"]
        cells = [VARIANTS[name].says, str(len(runs))]
        for setting_, size in itertools.product(settings, SIZES):
            them = [e for r, e in runs if ((r["machine"], r["freedom"]), size_of(r)) ==
                    (setting_, size)]  # fmt: skip
            cells.append(told(them))
        lines.append([*cells, told([effect for _, effect in runs])])
    head = ["variant", "runs"]
    head += [f"{machine} {freedom}, {size}" for (machine, freedom), size in
             itertools.product(settings, SIZES)]  # fmt: skip
    return markdown(lines, [*head, "all"])


def table(found: dict[str, list[tuple[dict[str, str], Effect]]]) -> str:
    """Return a line a print and setting: `hybrid`, its noise, and every variant's mean effect."""
    by_row = {name: grouped_effects(runs) for name, runs in found.items()}
    lines = []
    hybrids = by_row.get("hybrid", {})
    for row, runs in sorted(hybrids.items(), key=lambda item: int(item[1][0][0]["contours"])):
        less = statistics.fmean(float(r["less_percent"]) for r, _ in runs)
        apart = statistics.fmean(abs(effect.noise) for _, effect in runs)
        cells = [row[3], f"{row[0]} {row[1]}", runs[0][0]["contours"], str(len(runs))]
        cells += [f"{less:.2f}", f"{apart:.2f}"]
        for name in by_row:
            if name not in ("hybrid", "twin"):
                mine = by_row[name].get(row, [])
                more = [effect.more_percent for _, effect in mine]
                cells.append(f"{statistics.fmean(more):+.2f}" if more else "")
        lines.append(cells)
    head = ["print", "setting", "contours", "seeds", "hybrid less %", "twins apart %"]
    head += [VARIANTS[name].says for name in by_row if name not in ("hybrid", "twin")]
    return markdown(lines, head)


def grouped_effects(
    runs: list[tuple[dict[str, str], Effect]],
) -> dict[tuple[str, ...], list[tuple[dict[str, str], Effect]]]:
    found: dict[tuple[str, ...], list[tuple[dict[str, str], Effect]]] = {}
    for row, effect in runs:
        found.setdefault(tuple(row[name] for name in ROW), []).append((row, effect))
    return found


def missing(rows: list[dict[str, str]]) -> str:
    """Return sentences on what was not run, and what this benchmark does not look at."""
    models = [model for model in names(MODELS) if model not in {r["model"] for r in rows}]
    variants = [v.says for name, v in VARIANTS.items() if name not in {r["variant"] for r in rows}]
    text = f"Prints without a run: {', '.join(models)}. " if models else ""
    text += f"Variants without a run: {'; '.join(variants)}. " if variants else ""
    text += "Moves that slide the entries of neighbours together are part of the kernel and can "
    text += "not be left out. What it costs to keep lags is in [quality](quality.md).\n"
    return text


def plot(found: dict[str, list[tuple[dict[str, str], Effect]]], path: Path) -> None:
    import matplotlib.pyplot as plt

    drawn = [name for name in reversed(found) if name != "hybrid"]
    figure, axis = plt.subplots(figsize=(9, 0.6 + 0.36 * len(drawn)), layout="constrained")
    axis.axvline(0.0, color="grey")
    for size, colour in zip(SIZES, ("C0", "C1", "C2"), strict=True):
        if any(size_of(row) == size for name in drawn for row, _ in found[name]):
            said = f"prints of {size.replace('to', 'up to')} contours" if "to" in size else "larger"
            axis.plot([], [], "o", color=colour, label=said)
        for at, name in enumerate(drawn):
            more = [effect.more_percent for row, effect in found[name] if size_of(row) == size]
            axis.plot(more, [at] * len(more), "o", color=colour, alpha=0.6)
    axis.set_yticks(range(len(drawn)), [VARIANTS[name].says for name in drawn])
    axis.set_xscale("symlog", linthresh=0.5)
    axis.set(xlabel="travel more than hybrid, %")
    axis.grid(axis="x", alpha=0.3)
    figure.legend(loc="outside lower right", ncols=len(SIZES))
    figure.savefig(path, dpi=110)


def write_results(rows: list[dict[str, str]], options: argparse.Namespace) -> None:
    known = [r for r in rows if r["process"] == options.process and r["variant"] in VARIANTS]
    limits = grouped(known, "limit_s")
    mine = limits.pop((str(options.time_limit),), [])
    seeds = ",".join(sorted({r["seed"] for r in mine}, key=int))
    said = setting(
        note=options.note, quality="none", process_order=options.process,
        time_limit=f"{options.time_limit:g} s", seeds=seeds, seconds=CPU_TIME,
    )  # fmt: skip
    settings = ",".join(dict.fromkeys(f"{r['machine']}-{r['freedom']}" for r in mine))
    text = f"# What each part of `hybrid` is worth\n\n{said}\n\nRepeat: "
    text += f"`python benchmarks/ablation.py --settings {settings} --process {options.process} "
    text += f"--time-limit {options.time_limit:g} --seeds {seeds}{of_models(mine, MODELS)}`.\n\n"
    text += EXPLAINED.replace("\n", " ").strip() + "\n\n"
    found = effects(mine)
    text += f"## Mean effects\n\n{summary(found)}\n![ablation](ablation.png)\n\n"
    text += f"## Print by print\n\n{table(found)}\n"
    for (limit,), longer in limits.items():
        text += f"## At {float(limit):g} s\n\n{table(effects(longer))}\n"
    text += f"## What is missing\n\n{missing(mine)}"
    (options.results / "ablation.md").write_text(text)
    if found:
        plot(found, options.results / "ablation.png")


def main() -> None:
    parser = arguments(__doc__, time_limit=10.0, models=MODELS)
    parser.add_argument("--settings", type=names, default=["paper-reversible", "mk4s-seam"])
    parser.add_argument("--process", default="keep", choices=["keep", "free"])
    parser.add_argument("--variants", type=names, default=list(VARIANTS))
    options = parser.parse_args()
    rows = Rows(options.results / "ablation.csv", KEY)
    if not options.table_only:
        run_all(rows, options)
    write_results(rows.rows, options)


if __name__ == "__main__":
    main()
