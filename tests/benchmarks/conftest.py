"""A benchmark that runs in a test's process leaves the product as it was.

Variants without a part of the search put something else in its place; what is left there
decides what the tests behind it, in the same process, look at.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="session")
def _all_of_the_product() -> None:
    """Import every module: what a benchmark alone imports could not be compared."""
    for name in ("decmcts", "agents", "sim"):
        for module in pkgutil.walk_packages(importlib.import_module(name).__path__, f"{name}."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)


@pytest.fixture(autouse=True)
def _the_product_stays_as_it_was(request: pytest.FixtureRequest) -> Iterator[None]:
    """Of the long tests, which search: importing all takes seconds."""
    if request.node.get_closest_marker("long") is None:
        yield
        return
    request.getfixturevalue("_all_of_the_product")
    before = named()
    yield
    after = named()
    changed = {name for name, value in before.items() if after.get(name) is not value}
    assert not changed, f"left changed in the product: {sorted(changed)}"


def named() -> dict[str, Any]:
    """Return what functions, classes and capitals the modules name, and classes in turn."""
    found: dict[str, Any] = {}
    for place, module in list(sys.modules.items()):
        if place.split(".")[0] in ("decmcts", "agents", "sim"):
            for name, value in list(vars(module).items()):
                if callable(value) or name.isupper():
                    found[f"{place}.{name}"] = value
                if isinstance(value, type) and value.__module__ == place:
                    inner = {k: v for k, v in vars(value).items() if callable(v)}
                    found |= {f"{place}.{name}.{k}": v for k, v in inner.items()}
    return found
