"""Types and fields on the API page as the source writes them.

Autodoc evaluates annotations, so `NDArray[np.int32]` would become
`ndarray[tuple[Any, ...], dtype[int32]]`. It overlooks the comments in which dataclasses
state shapes and units, and documents a value by the docstring of its type.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING

from sphinx.pycode import ModuleAnalyzer
from sphinx.util.inspect import stringify_signature

import decmcts

if TYPE_CHECKING:
    from sphinx.application import Sphinx


def signature(
    _app: Sphinx, what: str, _name: str, member: object, *_options: object
) -> tuple[str, str | None] | None:
    """Return the arguments and the result of a function, with its annotations unevaluated."""
    if what not in ("function", "method") or not callable(member):
        return None
    written = inspect.signature(member)
    parameters = [p for p in written.parameters.values() if p.name not in ("self", "cls")]
    text = stringify_signature(written.replace(parameters=parameters), show_return_annotation=False)
    result = written.return_annotation
    return text, result if isinstance(result, str) else None


def add_fields(
    _app: Sphinx, what: str, _name: str, member: object, _options: object, lines: list[str]
) -> None:
    """Append a dataclass's fields, with types and comments, to its docstring in place."""
    if what == "class" and isinstance(member, type) and dataclasses.is_dataclass(member):
        lines += ["", *fields(member), ""]


def fields(member: type) -> Iterator[str]:
    """Yield, as a list, the public fields that a class itself states."""
    source = textwrap.dedent(inspect.getsource(member))
    rows = source.splitlines()
    (tree,) = ast.parse(source).body
    assert isinstance(tree, ast.ClassDef)
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            comment = rows[(node.end_lineno or 0) - 1].encode()[node.end_col_offset :].decode()
            said = comment.partition("#")[2].partition("  # ")[0].strip()
            said = re.sub(r"([*|])", r"\\\1", said)
            if not node.target.id.startswith("_"):
                yield f"* ``{node.target.id}``: ``{ast.unparse(node.annotation)}``" + (
                    f", {said}" if said else ""
                )


def document_value(
    _app: Sphinx, what: str, name: str, _member: object, _options: object, lines: list[str]
) -> None:
    """Replace the docstring of a public value's type by the one below the value, in place."""
    if what == "data":
        short = name.rpartition(".")[2]
        home = ModuleAnalyzer.for_module(decmcts._HOME.get(short, "decmcts.version"))
        lines[:] = home.find_attr_docs().get(("", short), [])


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("autodoc-process-signature", signature)
    app.connect("autodoc-process-docstring", add_fields)
    app.connect("autodoc-process-docstring", document_value)
    return {"parallel_read_safe": True}
