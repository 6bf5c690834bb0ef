"""Experiments from a name to files: the runs that are missing, a table and a figure.

Rows are computed by an executor of `concurrent.futures`, whatever is behind it, and kept one by
one as they come, so that an experiment which was stopped goes on where it was.
"""

from __future__ import annotations

import io
import multiprocessing
import os
import platform
import signal
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType

from decmcts.arguments import checked
from decmcts.errors import InputError, VerificationError
from decmcts.experiments.decentral_or_central import DECENTRAL_OR_CENTRAL
from decmcts.experiments.kinds import DPI, Asked, Experiment, Key, Line, Row, Rows
from decmcts.experiments.loss_and_failure import LOSS_AND_FAILURE
from decmcts.experiments.paper import PAPER
from decmcts.experiments.prints import own_prints
from decmcts.experiments.speed_up import TEAM_SIZE, TWO_HEADS
from decmcts.experiments.timing import TIMING
from decmcts.formats.files.atomic import write_whole
from decmcts.planning.compiling import is_compiled, made
from decmcts.planning.events import Note, Report, Step, unheard
from decmcts.planning.writing.places import refuse_place
from decmcts.print.brief import brief
from decmcts.version import __version__

SHARED = ("seconds", "iterations", "seed", "version")  # of every key


@dataclass(frozen=True, slots=True)
class Experimented:
    """What an experiment has found, and where it was put."""

    name: str
    rows: tuple[dict[str, str], ...]  # as in the CSV file, of the runs that were asked for
    page: str  # its tables, as Markdown
    paths: tuple[Path, ...]  # CSV file, page, figure

    __repr__ = brief("name", "rows", "failed", "paths")

    @property
    def failed(self) -> int:
        """How many of the runs have an error."""
        return sum(bool(row["error"]) for row in self.rows)


@checked
def experiment(
    name: str,
    folder: str | Path = ".",
    *,
    full: bool = False,
    prints: str | Path | None = None,
    time_limit_s: float | None = None,
    iterations: int | None = None,
    seeds: int | None = None,
    jobs: int | None = None,
    executor: Executor | None = None,
    report: Report = unheard,
) -> Experimented:
    """Make the runs of an experiment that are not there yet, and say what all of them show.

    Parameters
    ----------
    name : str
        Which experiment; ``decmcts experiment`` lists them.
    folder : str | Path
        Gets NAME.csv, NAME.md and NAME.png. Rows that are there at the same settings are not
        computed again.
    full : bool
        All of it: hours. Else a small version, a minute or two on two cores.
    prints : str | Path | None
        A folder of one's own G-code; None: prints made by code, and samples of the package.
    time_limit_s : float | None
        Processor time of each search, s; None: the experiment's own.
    iterations : int | None
        Rounds of each search, in place of seconds: then results depend on nothing else but seeds.
    seeds : int | None
        How many, from 0; None: the experiment's own number.
    jobs : int | None
        Processes; None: as many as there are cores.
    executor : Executor | None
        What computes rows, in place of processes of this call: it is not shut down. Its workers
        see the files of `prints` under the same paths.
    report : Report
        Told what is done.

    Returns
    -------
    Experimented
        All rows that were asked for, and where they are kept.

    Raises
    ------
    InputError
        For an unknown name, a limit that is none, or a folder without G-code.

    Examples
    --------
    >>> from decmcts import experiment
    >>> experiment("two-hats")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    decmcts.errors.InputError: no experiment 'two-hats'; there are two-heads, ...
    """
    if name not in EXPERIMENTS:
        raise InputError(f"no experiment {name!r}; there are {', '.join(EXPERIMENTS)}")
    chosen = EXPERIMENTS[name]
    for what, count in (("seeds", seeds), ("iterations", iterations), ("jobs", jobs)):
        if count is not None and count < 1:
            raise InputError(f"{count} {what} are none, at least 1 is needed")
    asked = Asked(full, () if prints is None else own_prints(Path(prints)))
    own = "" if prints is None else str(Path(prints).resolve())
    into = Path(folder)
    if into.exists() and not into.is_dir():
        raise InputError("it is no folder", path=into, advice="name another one with -o")
    into.mkdir(parents=True, exist_ok=True)
    csv, page, picture = (into / f"{name}{end}" for end in (".csv", ".md", ".png"))
    for path in (csv, page, picture):
        refuse_place(path)
    rows = Rows(csv, (*chosen.key, *SHARED))
    if rows.rows and not {*rows.key, "error"} <= set(rows.rows[0]):
        raise InputError(
            f"this is no table of the experiment {name}", path=csv, advice="name another folder"
        )
    keys = [{**key, "folder": own} for key in _keys(chosen, asked, time_limit_s, iterations, seeds)]
    missing = rows.missing(keys)
    if missing:
        _compile(chosen, report)
        _make(chosen, rows, missing, jobs or os.cpu_count() or 1, executor, report)
    return _shown(chosen, rows, keys, page, picture, report)


def _keys(
    chosen: Experiment, asked: Asked, seconds: float | None, iterations: int | None,
    seeds: int | None,
) -> Iterator[Key]:  # fmt: skip
    """Yield the keys of all runs that are asked for."""
    own = chosen.seconds[asked.full] if seconds is None else seconds
    count = int(chosen.seeds[asked.full]) if seeds is None else seeds
    for key in chosen.keys(asked):
        for seed in range(count):
            yield {
                **key, "seconds": 0.0 if iterations else own, "iterations": iterations or 0,
                "seed": seed, "version": __version__,
            }  # fmt: skip


def _compile(chosen: Experiment, report: Report) -> None:
    """Compile what the runs need, by two processes, before many would each compile all of it."""
    missing = [part for part in chosen.compiled if not is_compiled(part)]
    for k, part in enumerate(made(missing), 1):
        report(Step(f"compiling, once: {part} is done", k, len(missing)))


def _make(
    chosen: Experiment, rows: Rows, missing: list[Key], jobs: int, executor: Executor | None,
    report: Report,
) -> None:  # fmt: skip
    """Make runs and keep their rows as they come."""
    report(Step(f"{chosen.name}: the first of {len(missing)} runs", 1, len(missing)))
    with _processes(min(jobs, len(missing))) if executor is None else nullcontext(executor) as by:
        futures = [by.submit(compute, chosen.name, key) for key in missing]
        try:
            for done, future in enumerate(as_completed(futures), 1):
                row = future.result()
                rows.append(row)
                which = " ".join(str(row[name]) for name in chosen.key)
                if row["error"]:
                    report(Note(f"{which}: {row['error']}"))
                report(Step(f"{chosen.name}: {which} is done", done, len(missing)))
        finally:
            for future in futures:
                future.cancel()


@contextmanager
def _processes(jobs: int) -> Iterator[Executor]:
    """Start processes; they end with this block, whatever they are at."""
    before = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, context, signal.signal, (signal.SIGINT, signal.SIG_IGN))
    try:
        yield pool
    except BaseException:
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _shown(
    chosen: Experiment, rows: Rows, keys: list[Key], page: Path, picture: Path, report: Report
) -> Experimented:
    """Write the page and the figure of the rows that were asked for."""
    report(Step("table and figure"))
    rows.read()
    wanted = [tuple(str(key[name]) for name in rows.key) for key in keys]
    last = {rows.key_of(row): row for row in rows.rows}
    mine = [last[key] for key in wanted if key in last]
    text = f"{chosen.question}\n\n{_setting(mine)}\n\n{chosen.tables(mine)}"
    write_whole(page, text.encode(errors="replace"))  # names of files may be no text
    image = io.BytesIO()
    chosen.draw(mine).savefig(image, format="png", dpi=DPI)
    write_whole(picture, image.getvalue())
    return Experimented(chosen.name, tuple(mine), text, (rows.path, page, picture))


def _setting(rows: Sequence[Line]) -> str:
    """Return one line on what was run, and with which versions."""

    def of(name: str) -> str:
        return " ".join(dict.fromkeys(row[name] for row in rows))

    limit = f"{of('seconds')} s of processor time a search"
    limit = limit if of("iterations") == "0" else f"{of('iterations')} iterations a search"
    cpu_s = sum(float(row["cpu_s"]) for row in rows)
    return (
        f"{len(rows)} runs, {sum(bool(row['error']) for row in rows)} failed; {limit}; seeds "
        f"{of('seed')}; {cpu_s / 60.0:.1f} minutes of processor time; decmcts {of('version')}, "
        f"numpy {of('numpy')}, numba {of('numba')}, Python {of('python')}"
    )


_ALL = (TWO_HEADS, TEAM_SIZE, TIMING, LOSS_AND_FAILURE, DECENTRAL_OR_CENTRAL, PAPER)
EXPERIMENTS: Mapping[str, Experiment] = MappingProxyType({each.name: each for each in _ALL})


def compute(name: str, key: Key) -> Row:
    """Make one run of an experiment and return its row; why it is refused stands in `error`."""
    began = time.process_time()
    try:
        if key["version"] != __version__:
            raise InputError(f"this worker has decmcts {__version__}, not {key['version']}")
        found: Row = EXPERIMENTS[name].run(key)
        error = ""
    except (InputError, VerificationError) as refused:
        found, error = {}, " ".join(str(refused).split())
    asked = {field: value for field, value in key.items() if field != "folder"}
    return {
        **asked, **found, "cpu_s": round(time.process_time() - began, 2),
        "python": platform.python_version(), "numpy": version("numpy"), "numba": version("numba"),
        "error": error,
    }  # fmt: skip


CONNECT_S = 10.0


@contextmanager
def cluster_at(address: str) -> Iterator[Executor]:
    """Yield what computes by the workers of a cluster, each of which has this version installed.

    InputError where Dask is not installed, or no scheduler answers at the address.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError("a cluster needs Dask", advice="pip install 'decmcts[cluster]'") from None
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        why = " ".join(str(error).split())
        raise InputError(
            f"no cluster at {address}: {why}", advice="name its scheduler: tcp://HOST:8786"
        ) from error
    with client:
        yield client.get_executor()
