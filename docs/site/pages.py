"""What the site adds to the Markdown pages: its contents, and the sections of the API page.

The API page documents all that `decmcts.__all__` names, then the modules that
those names come from or return.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterable, Mapping
from enum import Enum
from typing import TYPE_CHECKING

import decmcts

if TYPE_CHECKING:
    from sphinx.application import Sphinx

CONTENTS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "README": {
        "Use": (
            "docs/options",
            "docs/report",
            "docs/gallery",
            "docs/first-print-on-two-heads",
            "docs/simulate",
            "docs/run",
            "docs/replan",
            "docs/experiments",
            "docs/machine-format",
            "docs/measure-your-head",
            "docs/meshes",
            "docs/gcode",
            "docs/dialects",
            "docs/gains",
        ),
        "Programs around it": (
            "docs/api",
            "examples/README",
            "docs/site/api",
            "docs/plan-format",
            "docs/events",
            "docs/json-output",
            "docs/sop",
            "docs/qcsp",
        ),
        "How it works": (
            "ARCHITECTURE",
            "docs/definitions",
            "docs/search",
            "docs/team",
            "docs/team-measured",
            "docs/glossary",
            "docs/protocol",
            "docs/security",
            "docs/adr/README",
            "docs/results/README",
        ),
        "Work on it": ("CONTRIBUTING", "CHANGELOG"),
    },
    "docs/adr/README": {"Decisions": ("*",)},
    "docs/results/README": {"Results": ("*",)},
}  # captions and pages under a page

MODULES: Mapping[str, tuple[str, ...]] = {
    "A print and a machine": (
        "decmcts.print.contours",
        "decmcts.print.job",
        "decmcts.print.machine",
        "decmcts.print.machine_fit",
        "decmcts.print.toolpath",
        "decmcts.print.plan",
        "decmcts.samples",
        "decmcts.errors",
    ),
    "Reading and writing": (
        "decmcts.formats.gcode",
        "decmcts.formats.mesh",
        "decmcts.formats.machines.machine_file",
        "decmcts.formats.plans.plan_json",
        "decmcts.formats.bare.sop",
        "decmcts.formats.bare.qcsp",
    ),
    "Planning": (
        "decmcts.feasibility.rules",
        "decmcts.feasibility.graph",
        "decmcts.search.sequence.problem",
        "decmcts.search.sequence.planner",
        "decmcts.search.planners",
        "decmcts.search.bounds.certificate",
        "decmcts.search.sop.solver",
        "decmcts.team.schedule.joint_plan",
        "decmcts.team.qcsp.solver",
    ),
    "Judging": ("sim.verify", "sim.qcsp"),
}


def contents(page: str) -> str:
    """Return the hidden tables of contents of a page, as Markdown."""
    lines = []
    for caption, pages in CONTENTS.get(page, {}).items():
        lines += ["", "```{toctree}", ":hidden:", ":glob:", f":caption: {caption}", "", *pages]
        lines += ["```", ""]
    return "\n".join(lines)


def api() -> str:
    """Return the sections of the API page, as Markdown."""
    public = list(getattr(decmcts, "__all__", ()))
    known = {id(getattr(decmcts, name)) for name in public}
    lines = ["", "## `decmcts`", "", *_block(_entries("decmcts", public))] if public else []
    for title, modules in MODULES.items():
        lines += ["", f"## {title}"]
        for module in modules:
            names = [name for name, member in _members(module) if id(member) not in known]
            head = [f".. automodule:: {module}", ""]
            lines += ["", f"### `{module}`", "", *_block(head + _entries(module, names))]
    return "\n".join(lines)


def _members(module_name: str) -> list[tuple[str, object]]:
    """Return a module's public functions and classes: those it exports, else its own."""
    module = importlib.import_module(module_name)
    exported = getattr(module, "__all__", None)
    return [
        (name, member)
        for name, member in vars(module).items()
        if (inspect.isclass(member) or inspect.isfunction(member))
        and not name.startswith("_")
        and (name in exported if exported else member.__module__ == module_name)
    ]


def _entries(module_name: str, names: Iterable[str]) -> list[str]:
    """Return the directives that document names of a module."""
    module = importlib.import_module(module_name)
    lines = []
    for name in names:
        member = getattr(module, name)
        kind = "class" if inspect.isclass(member) else "data"
        kind = "function" if inspect.isroutine(member) else kind
        options = ["   :members:"] if kind == "class" else []
        options += ["   :undoc-members:"] if kind == "class" and issubclass(member, Enum) else []
        lines += [f".. auto{kind}:: {module_name}.{name}", *options, ""]
    return lines


def _block(lines: Iterable[str]) -> list[str]:
    """Return reStructuredText as a block of a Markdown page."""
    return ["```{eval-rst}", *lines, "```"]


def add_generated(_app: Sphinx, page: str, source: list[str]) -> None:
    """Append to a page, in place, what is generated for it."""
    source[0] += contents(page)
    if page == "docs/site/api":
        source[0] += api()


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("source-read", add_generated)
    return {"parallel_read_safe": True}
