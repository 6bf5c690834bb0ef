"""Filament by tool: what each file of many slicers pushes and pulls, and what is written of it.

    python benchmarks/ledger.py [--time-limit 1]

Each file of the corpus is planned for the machine it names, else for `paper`. Source and result
are then read by a small reader of this script's own, which shares no code with the program: E
words, how they count, and the tool in use. A tool's net, pushed less pulled, must be in the
result what it is in the source, to 1e-4 mm; what is pushed and pulled on the way depends on the
order. Writes docs/results/ledger.csv (resumable) and docs/results/ledger.md; exits with 1 where a
net differs.
"""

from __future__ import annotations

import argparse
import gzip
import math
import re
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from common import RESULTS, Rows, corpus, markdown, measured, print_path, setting

KEY = ("file", "limit_s")
SAME_MM = 1e-4
_WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))")
_CODE = re.compile(r"([GMT])\s*0*(\d+(?:\.\d+)?)(?![\w.])")


@dataclass(slots=True)
class Tool:
    """What one tool does in a file, mm of filament."""

    pushed: float = 0.0
    pulled: float = 0.0
    withdrawals: int = 0  # G10: how far is the firmware's

    @property
    def net(self) -> float:
        """Return what comes out."""
        return self.pushed - self.pulled


def ledger(lines: Iterable[str]) -> dict[int, Tool]:
    """Return what each tool does in a file, line by line as a controller would."""
    words = [_words(line) for line in lines]
    relative = _counts_up(words)
    tools: dict[int, Tool] = defaultdict(Tool)
    frame, tool, e, area = False, 0, 0.0, 1.0
    for name, given in words:
        if name in ("M82", "M83"):
            relative = name == "M83"
        elif name in ("G90", "G91"):
            frame = name == "G91"
        elif name == "M200" and given.get("D"):
            area = math.pi * given["D"] ** 2 / 4.0
        elif name == "G92":
            e = given.get("E", e if given else 0.0)
        elif name == "G28" and "E" in given:
            e = 0.0
        elif name[:1] == "T" and name[1:].isdigit() and int(name[1:]) <= 254:
            tool = int(name[1:])
        elif name == "G10" and not given:
            tools[tool].withdrawals += 1
        elif name in ("G0", "G1", "G2", "G3") and "E" in given:
            amount = given["E"] if relative or frame else given["E"] - e
            e = e + amount if relative or frame else given["E"]
            if amount > 0.0:
                tools[tool].pushed += amount / area
            else:
                tools[tool].pulled -= amount / area
    return tools


def _words(line: str) -> tuple[str, dict[str, float]]:
    """Return a line's command, as G1, and its numbers by letter; comments are left out."""
    code = re.sub(r"\([^)]*\)", "", line.split(";", 1)[0]).strip().upper()
    code = re.sub(r"^N\d+\s*|\*\d+\s*$", "", code)
    found = _CODE.match(code)
    if not found:
        return code.split(" ", 1)[0], {}
    name = found[1] + (found[2] if "." in found[2] else str(int(found[2])))
    return name, {letter: float(value) for letter, value in _WORD.findall(code[found.end() :])}


def _counts_up(words: list[tuple[str, dict[str, float]]]) -> bool:
    """Tell whether E counts from move to move where no M82 or M83 says: it falls often then."""
    if any(name in ("M82", "M83") for name, _ in words):
        return False
    drawn = [
        w["E"] for name, w in words
        if name in ("G0", "G1", "G2", "G3") and "E" in w and w.keys() & {"X", "Y", "Z"}
    ]  # fmt: skip
    falls = sum(b < a for a, b in pairwise(drawn))
    return len(drawn) > 1 and falls > 0.1 * (len(drawn) - 1)


def lines_of(path: Path) -> list[str]:
    """Return the lines of a file, plain or gzipped."""
    raw = path.read_bytes()
    text = gzip.decompress(raw) if raw[:2] == b"\x1f\x8b" else raw
    return text.decode("latin-1").splitlines()


def compared(path: Path, limit: float) -> dict[str, Any]:
    """Plan a file, and return one row: what each of its tools does before and after."""
    row: dict[str, Any] = {"file": path.name, "limit_s": limit}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "out.gcode")
        for machine in ([], ["--machine", "mk4s"], ["--machine", "paper"]):
            done = measured(
                ["plan", str(path), "-o", str(out), *machine, "--time-limit", str(limit),
                 "--no-certificate", "--allow-slower"]
            )  # fmt: skip
            if done["exit"] == 0:
                break
        why = done.get("error", "").removeprefix("decmcts: ")
        row["error"] = why.replace(f"{path.parent}/", "")
        if done["exit"] != 0:
            return row
        before, after = ledger(lines_of(path)), ledger(lines_of(out))
    tools = sorted(before.keys() | after.keys())
    for name in ("pushed", "pulled", "net"):
        for when, book in (("source", before), ("result", after)):
            row[f"{name}_{when}"] = " ".join(f"{getattr(book[t], name):.5f}" for t in tools)
    for when, book in (("source", before), ("result", after)):
        row[f"withdrawals_{when}"] = sum(book[t].withdrawals for t in tools)
    row["tools"] = " ".join(map(str, tools))
    row["off_mm"] = max((abs(before[t].net - after[t].net) for t in tools), default=0.0)
    return row


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--time-limit", type=float, default=1.0, help="seconds a search")
    parser.add_argument("--files", default="", help="only those with this in their name")
    parser.add_argument("--models", default="", help="a print that ships, not the corpus: NAME")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder that is written")
    args = parser.parse_args()
    rows = Rows(args.results / "ledger.csv", KEY)
    for path in files(args.models, args.files):
        if not rows.has(file=path.name, limit_s=args.time_limit):
            rows.append(compared(path, args.time_limit))
            last = rows.rows[-1]
            print(last["file"], last.get("off_mm", ""), last["error"], flush=True)
    (args.results / "ledger.md").write_text(report(rows, args.time_limit))
    return int(any(float(row["off_mm"]) > SAME_MM for row in rows.rows if row.get("off_mm")))


def files(model: str, part: str) -> list[Path]:
    """Return the G-code files to compare, small ones first."""
    if model:
        return [print_path(model)]
    found = [path for path in (corpus() / "gcode").glob("*.gcode.gz") if part in path.name]
    return sorted(found, key=lambda path: (path.stat().st_size, path.name))


def report(rows: Rows, limit: float) -> str:
    """Return the table as a page."""
    head = ["file", "tool", "pushed, mm", "pulled, mm", "net, mm", "difference, mm"]
    table = []
    ran = sorted(rows.rows, key=lambda row: row["file"])
    made = [row for row in ran if not row["error"] and float(row["limit_s"]) == limit]
    for row in made:
        parts = {name: row[name].split() for name in row if name.endswith(("source", "result"))}
        for k, tool in enumerate(row["tools"].split()):
            both = [
                f"{float(parts[f'{name}_source'][k]):.2f} → {float(parts[f'{name}_result'][k]):.2f}"
                for name in ("pushed", "pulled")
            ]
            nets = [float(parts[f"net_{when}"][k]) for when in ("source", "result")]
            table.append(
                [row["file"], tool, *both, f"{nets[0]:.5f}", f"{abs(nets[1] - nets[0]):.5f}"]
            )
    worst = max((float(row["off_mm"]) for row in made), default=0.0)
    return (
        "# Filament by tool\n\n"
        "What is pushed and pulled on the way depends on the order; what comes out of each tool "
        "does not.\nCounted by the benchmark's own reader, source → result. "
        f"Largest difference: {worst:.1e} mm, over {len(made)} files.\n\n"
        f"    python benchmarks/ledger.py --time-limit {limit:g}\n\n"
        f"{setting(limit=f'{limit:g} s')}\n\n" + markdown(table, head) + rows.failures()
    )


if __name__ == "__main__":
    sys.exit(main())
