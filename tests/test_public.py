"""What programs use: every name is there, is described, and does what its example says."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import decmcts
from decmcts.print.metrics import Metrics
from decmcts.print.plan import PlanDocument

ROOT = Path(__file__).parents[1]
WORK = (
    "bound",
    "experiment",
    "from_arrays",
    "launch",
    "plan",
    "read",
    "solve_qcsp",
    "solve_sop",
    "verify",
)
SLOW = ("decmcts.planning",)


def with_examples() -> list[str]:
    """Return the names of all modules whose docstrings have examples."""
    found = []
    for room in ("decmcts", "agents", "sim"):
        for path in sorted((ROOT / room).rglob("*.py")):
            if ">>>" in path.read_text():
                parts = path.relative_to(ROOT).with_suffix("").parts
                found.append(".".join(part for part in parts if part != "__init__"))
    return found


@pytest.mark.parametrize(
    "module",
    [
        pytest.param(name, marks=pytest.mark.slow if name.startswith(SLOW) else ())
        for name in with_examples()
    ],
)
def test_examples_of_docstrings_run(module: str) -> None:
    """Readers copy them."""
    done = doctest.testmod(importlib.import_module(module))
    assert done.attempted and not done.failed


def test_every_public_name_is_there() -> None:
    """Also those that are loaded only when they are asked for."""
    assert set(decmcts.__all__) <= set(dir(decmcts))
    for name in decmcts.__all__:
        assert getattr(decmcts, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'plam'"):
        decmcts.plam  # type: ignore[attr-defined]  # noqa: B018 - that is what is tested


@pytest.mark.parametrize("name", WORK)
def test_public_functions_are_described_in_full(name: str) -> None:
    """Parameters, what comes back, what is raised, and an example that runs."""
    text = inspect.getdoc(getattr(decmcts, name)) or ""
    for section in ("Parameters", "Returns", "Raises", "Examples"):
        assert f"\n{section}\n---" in text
    for parameter in inspect.signature(getattr(decmcts, name)).parameters.values():
        assert parameter.kind != parameter.VAR_KEYWORD


def types_said(thing: object) -> Iterator[str]:
    """Yield every type a public function, or class with its public methods, says."""
    if inspect.isclass(thing):
        yield from map(str, inspect.get_annotations(thing).values())
        for name, member in vars(thing).items():
            if not name.startswith("_"):
                member = member.fget if isinstance(member, property) else member
                yield from types_said(getattr(member, "__func__", member))
    elif inspect.isfunction(thing):
        signature = inspect.signature(thing)
        yield str(signature.return_annotation)
        yield from (str(parameter.annotation) for parameter in signature.parameters.values())


@pytest.mark.parametrize("name", decmcts.__all__)
def test_types_of_the_public_names_say_something(name: str) -> None:
    """`Any` switches the checker of whoever uses them off; a plan and its figures count too."""
    things = [getattr(decmcts, name), PlanDocument, Metrics]
    assert not [said for thing in things for said in types_said(thing) if "Any" in said]


def test_the_packages_say_they_are_typed() -> None:
    """Else type checkers of those who use them see nothing."""
    assert all((ROOT / room / "py.typed").exists() for room in ("decmcts", "agents", "sim"))


def test_type_checkers_see_the_names_that_are_there() -> None:
    """Names are stated twice: where they are imported from, for checkers and for the program."""
    tree = ast.parse((ROOT / "decmcts" / "__init__.py").read_text())
    seen = {
        alias.name: node.module
        for block in tree.body
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == decmcts._HOME
    assert set(decmcts.__all__) == {*seen, "__version__"}


def test_importing_loads_no_compiler() -> None:
    """Programs that only ask for the version do not wait a second."""
    code = "import sys, decmcts; decmcts.InputError; print('numba' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "False"


def test_a_command_begins_without_what_draws() -> None:
    """Pictures and filters of images take as long to load as a third of all else."""
    code = (
        "import sys, decmcts.cli.run; "
        "print([name for name in ('matplotlib', 'scipy.ndimage') if name in sys.modules])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"
