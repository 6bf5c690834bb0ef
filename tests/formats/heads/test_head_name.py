"""Names of heads: they become part of file names and of the files' headers."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from decmcts.errors import InputError
from decmcts.formats.machines.machine_dict import machine_from_dict, machine_to_dict
from decmcts.formats.machines.machine_file import load_machine
from sim.heads.file import header_of

GOOD = ["T0", "Kopf links", "ü (x)", "a, file 1", "x;y", "打印头", "..", "-o", "n" * 64]
BAD = [
    "", " ", " a ", "a ", "\u00a0a", "a\nb", "a\tb", "a\x00", "a\x85b", "a\u2028b", "a\u202eb",
    "a/b", "a\\b", "a:b", "a*b", "a?b", 'a"b', "a<b", "a>b", "a|b", "n" * 65, "é" * 33, "\ud800",
]  # fmt: skip


def machine_with(*names: str) -> dict[str, Any]:
    """Return a machine as a mapping, its heads named so."""
    values = copy.deepcopy(machine_to_dict(load_machine("dual-gantry")))
    values["rails"] = []
    for head, name in zip(values["heads"], names, strict=True):
        head["name"] = name
    return values


@pytest.mark.parametrize("name", GOOD)
def test_what_files_can_be_called_is_a_name(name: str) -> None:
    """And the judge reads it back from the header of the head's file."""
    assert machine_from_dict(machine_with(name, "other")).heads[0].name == name
    text = f"; made\n; head {name}, file 1 of 2: to be run together\nG28\n"
    assert header_of(text.encode()) == (name, (1, 2))


@pytest.mark.parametrize("name", BAD)
def test_what_no_file_can_be_called_is_refused(name: str) -> None:
    """Found when the machine is read: the search would be in vain, or the files another's."""
    with pytest.raises(InputError, match=r"m\.toml: heads\[1\]\.name: .*(64 bytes|ud800)") as said:
        machine_from_dict(machine_with("other", name), path="m.toml")
    str(said.value).encode()


@pytest.mark.parametrize(("one", "two"), [("A", "a"), ("é", "e\u0301"), ("ß", "SS")])
def test_names_that_differ_by_case_are_refused(one: str, two: str) -> None:
    """They are one file on macOS and Windows."""
    with pytest.raises(InputError, match=r"heads\[1\]\.name: .*heads are named"):
        machine_from_dict(machine_with(one, two))
