"""One agent as a child process: spawned, listened to, commanded, ended by its id.

Children are spawned (a fork of an open zenoh session hangs) in a session of
their own, so Ctrl-C reaches the launcher alone and it decides what they do.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, BinaryIO

from agents.networks.meeting import Meeting
from decmcts.errors import InputError
from decmcts.formats.files.names import harmless

_STOP_S = 3.0
_END_S = 1.0
BAD_INPUT = 2  # exit code
PREFIX = "decmcts: "  # of every error the program says
PIPED = "--piped"  # to an agent: its arguments follow as one line on stdin


@dataclass(frozen=True, slots=True, eq=False)
class AgentLine:
    """A line an agent wrote, or None when its output ended."""

    head: int
    line: dict[str, Any] | None


class AgentProcess:
    """A running agent of this launcher.

    `receive` takes the lines it writes, in a thread of its own; it `inherits` descriptors from us,
    by the same numbers.
    """

    def __init__(
        self,
        head: int,
        command: Sequence[str],
        receive: Callable[[AgentLine], None],
        inherits: Sequence[int] = (),
    ) -> None:
        self.head = head
        self._errors: BinaryIO = tempfile.TemporaryFile()  # noqa: SIM115 - closed in `reap`
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            start_new_session=True,
            pass_fds=inherits,
        )
        # Daemon: a reader stuck on a pipe must not keep a crashed launcher alive.
        self._reader = threading.Thread(target=self._read, args=(receive,), daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self._process.poll() is None

    def send(self, command: dict[str, Any]) -> None:
        """Write one command line; a dead agent hears nothing."""
        pipe = self._process.stdin
        if pipe is None or pipe.closed:
            return
        with suppress(BrokenPipeError):  # it ended; its end is read from its output
            pipe.write(json.dumps(command).encode() + b"\n")
            pipe.flush()

    def begin(self, arguments: Sequence[str], meeting: Meeting | None = None) -> None:
        """Hand its arguments to an agent that was started with `PIPED` alone."""
        met = {} if meeting is None else {"meeting": meeting.to_dict()}
        self.send({"command": "begin", "arguments": list(arguments), **met})

    def kill(self) -> None:
        """End it for sure and wait for it: after this the head is fenced."""
        if self.running:
            self._process.kill()
        self._process.wait()

    def reap(self) -> None:
        """Wait shortly, kill if needed, free the pipes."""
        if self._process.stdin is not None:
            with suppress(BrokenPipeError):
                self._process.stdin.close()
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self.kill()
        self._reader.join(_STOP_S)
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._errors.close()

    def died(self) -> bool:
        """Tell whether it ended by a signal or an error, not by leaving or over its input."""
        return self._code() not in (None, 0, BAD_INPUT)

    def _code(self) -> int | None:
        """Return its exit code; None: its pipe closed and it runs on."""
        try:
            return self._process.wait(_END_S)  # its pipe closes a moment before
        except subprocess.TimeoutExpired:
            return None

    def ending(self) -> str:
        """Return how it ended, in words: by a signal, with its last words, or just so."""
        code = self._code()
        if code is not None and code < 0:
            return f"killed by {_signal_name(-code)}"
        return self.last_words() or ("" if code is None else f"its process ended ({code})")

    def last_words(self) -> str:
        """Return the last line it wrote to stderr, without the program's name."""
        self._errors.seek(0)
        lines = self._errors.read()[-4096:].decode(errors="replace").strip().splitlines()
        return lines[-1].removeprefix(PREFIX) if lines else ""

    def _read(self, receive: Callable[[AgentLine], None]) -> None:
        pipe = self._process.stdout
        assert pipe is not None
        for raw in pipe:
            try:
                line = json.loads(raw)
            except ValueError:
                continue  # not ours: a library printed
            if isinstance(line, dict):
                receive(AgentLine(self.head, line))
        receive(AgentLine(self.head, None))


def failed(error: Exception) -> int:
    """Write what went wrong as the last line that `last_words` reads; return the exit code.

    For the agent's own process. A trace helps nobody where that line is shown.
    """
    if isinstance(error, InputError):
        print(harmless(f"{PREFIX}{error}"), file=sys.stderr)
        return BAD_INPUT
    print(harmless(f"{PREFIX}{type(error).__name__}: {error}"), file=sys.stderr)
    return 1


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # a real-time signal
        return f"signal {number}"
