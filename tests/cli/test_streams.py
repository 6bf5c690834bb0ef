"""Output that cannot fail: whatever the terminal, log or pipe is, a finished run stays finished."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_bad_input import SQUARE, gcode

SAY = (
    "import sys; from decmcts.cli import streams; streams.forgive();"
    "print('5 → 3 ≥ 2 mm² µm Γ é 漢');"
    "sys.stdout.flush(); sys.stderr.write('no ≥\\n'); sys.stderr.flush(); sys.exit(7)"
)


def said(shell: str, code: str = SAY, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """Run `code` as `$PROGRAM` in a shell line."""
    known = {**os.environ, "PROGRAM": sys.executable, "CODE": code, **environment}
    return subprocess.run(["/bin/sh", "-c", shell], capture_output=True, env=known, check=False)


@pytest.mark.parametrize(
    ("encoding", "words"),
    [
        ("ascii", b"5 -> 3 >= 2 mm2 um Gamma e ?\n"),
        ("cp1252", b"5 -> 3 >= 2 mm\xb2 \xb5m Gamma \xe9 ?\n"),
        ("cp437", b"5 -> 3 \xf2 2 mm\xfd \xe6m \xe2 \x82 ?\n"),
        ("latin-1:strict", b"5 -> 3 >= 2 mm\xb2 \xb5m Gamma \xe9 ?\n"),
    ],
)
def test_what_an_encoding_lacks_is_written_in_other_letters(encoding: str, words: bytes) -> None:
    """An arrow in a summary ended a run that had already rewritten its file."""
    run = said('"$PROGRAM" -c "$CODE"', PYTHONIOENCODING=encoding)
    assert (run.returncode, run.stdout) == (7, words)


def test_bytes_of_a_name_that_are_no_text_are_written_as_they_are() -> None:
    """A file's name may be anything; it must be possible to name it."""
    code = SAY.replace("'no ≥\\n'", r"'a\udcff\n'")
    assert said('"$PROGRAM" -c "$CODE"', code, PYTHONIOENCODING="utf-8").stderr == b"a\xff\n"


@pytest.mark.parametrize(
    ("shell", "error"),
    [
        ('"$PROGRAM" -c "$CODE" >&-', "no ≥\n"),
        ('"$PROGRAM" -c "$CODE" 2>&-', ""),
        ('"$PROGRAM" -c "$CODE" >&- 2>&- <&-', ""),
        ('"$PROGRAM" -c "$CODE" >/dev/full 2>/dev/full', ""),
        (
            '"$PROGRAM" -c "$CODE" >/dev/full',
            "decmcts: standard output cannot be written (No space left on device)\nno ≥\n",
        ),
    ],
)
def test_a_stream_that_cannot_be_written_changes_no_exit_code(shell: str, error: str) -> None:
    """Closed, full or both: the code is that of the work, and a full disk is said once."""
    run = said(shell, PYTHONIOENCODING="utf-8")
    assert (run.returncode, run.stderr.decode()) == (7, error)


def test_a_pipe_nobody_reads_is_no_error() -> None:
    """`| head -1` ends the reader first."""
    code = SAY.replace("print(", "[print(i) for i in range(99999)]; print(")
    shell = '{ "$PROGRAM" -c "$CODE"; echo "code $?" >&2; } | head -1'
    run = said(shell, code, PYTHONIOENCODING="utf-8")
    assert run.stdout == b"0\n"
    assert run.stderr.decode() == "no ≥\ncode 7\n"


def test_no_file_takes_the_place_of_a_closed_stream(tmp_path: Path) -> None:
    """With standard error closed, the next file opened had its number: messages went into it."""
    result = tmp_path / "part.gcode"
    code = (
        "import os; from decmcts.cli import streams; streams.forgive();"
        f"file = open({str(result)!r}, 'w'); os.write(2, b'stopping'); file.write('G28')"
    )
    assert said('"$PROGRAM" -c "$CODE" 2>&-', code).returncode == 0
    assert result.read_text() == "G28"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shell", "encoding"),
    [
        ('"$PROGRAM" -m decmcts.cli $WORDS', "cp1252"),
        ('"$PROGRAM" -m decmcts.cli $WORDS >/dev/full 2>&-', "ascii"),
    ],
)
def test_post_ends_well_whatever_it_talks_to(tmp_path: Path, shell: str, encoding: str) -> None:
    """The file is rewritten before the summary: an exit code of 70 would throw the export away."""
    source = tmp_path / "part.gcode"
    source.write_text(gcode(SQUARE))
    words = f"post {source} --machine paper --time-limit 0.1 --allow-slower"
    run = said(shell, WORDS=words, PYTHONIOENCODING=encoding)
    assert run.returncode == 0, run.stderr
    assert "reordered by decmcts" in source.read_text()
