"""Files of other programs: whatever they hold, one line says what is wrong with it."""

from __future__ import annotations

import pytest

from decmcts.errors import InputError
from decmcts.formats.files.reading import (
    first_twice,
    once,
    one_line,
    read_bytes,
    read_json,
    read_toml,
)
from decmcts.formats.machines.machine_file import load_machine

DIGITS = b"1" * 5000
TEXTS = [
    (b"", "no JSON"),
    (b"{\xff}", "no UTF-8 text, so no profile"),
    (b"[" * 200_000, "nested too deeply to be a profile"),
    (b'{"a": %s}' % DIGITS, "a number of more than 4300 digits"),
    (b"[]", "is no profile: expected an object"),
]


@pytest.mark.parametrize(("content", "said"), TEXTS)
def test_what_is_no_json_object_is_one_line(tmp_path, content, said):
    """Python's reader has four kinds of error for what is no JSON, two of them surprising."""
    file = tmp_path / "a.json"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"a\.json") as error:
        read_json(file, "profile")
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"a = 1\nb = \n", "a.toml:2: "),
        (b"a = \xff", "no UTF-8 text, so no list"),
        (b"a = 1\na = 2", "; see docs/list.md"),
        (b"a = %s" % (b"[" * 200_000), "nested too deeply to be a list"),
        (b"a = %s" % DIGITS, "a number of more than 4300 digits"),
    ],
)
def test_what_is_no_toml_is_one_line(tmp_path, content, said):
    """With its line where Python's reader knows it, and where to look it up."""
    file = tmp_path / "a.toml"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"a\.toml") as error:
        read_toml(file, "list", page="docs/list.md")
    assert said in str(error.value)


def test_a_folder_and_a_missing_file_are_named(tmp_path):
    """What the system says of them is enough."""
    for path in (tmp_path, tmp_path / "gone"):
        with pytest.raises(InputError, match=r"cannot be read \("):
            read_bytes(path)


def test_an_error_that_is_a_line_already_stays_as_it_is():
    """A reader's own message knows more."""
    with pytest.raises(InputError, match="own message"), one_line(__file__, "profile"):
        raise InputError("own message")


def test_a_byte_order_mark_is_no_part_of_a_toml(tmp_path):
    """Editors write one; it was called an invalid statement in line 1."""
    file = tmp_path / "a.toml"
    file.write_bytes(b"\xef\xbb\xbfa = 1\n")
    assert read_toml(file, "list", page="docs/list.md") == {"a": 1}


@pytest.mark.parametrize("name", ["m.json", "m.json:MK4S", "m.toml"])
@pytest.mark.parametrize(
    ("content", "said"), [(b"[" * 50_000, "nested too deeply"), (DIGITS, "4300 digits")]
)
def test_machines_no_reader_gets_through_are_one_line(tmp_path, name, content, said):
    """Each of these ended in exit code 70."""
    file = tmp_path / name.partition(":")[0]
    file.write_bytes((b"a = " if file.suffix == ".toml" else b"") + content)
    with pytest.raises(InputError, match=said):
        load_machine(str(tmp_path / name))


def test_a_key_that_stands_twice_is_found_in_one_walk(tmp_path):
    """A search for each key from the beginning took minutes; the first in the file is named."""
    asked = []

    class Name(str):
        __slots__ = ()

        def __eq__(self, other: object) -> bool:
            asked.append(1)
            return str.__eq__(self, other)

        __hash__ = str.__hash__

    names = [Name(f"k{i}") for i in range(2000)]
    assert first_twice([*names, Name("k1999"), Name("k7")]) == "k7"
    assert len(asked) < 3 * len(names)
    assert first_twice(names) is None
    with pytest.raises(InputError, match="the key 'b' stands twice"):
        once(tmp_path)([("a", 1), ("b", 1), ("b", 2)])
