"""Process of a stack: lines to its standard input, lines from its standard output, time limits.

The process leads a group of its own, which is killed as a whole at the end of a run. So are
processes that it has started in other groups; on Linux, they are found by their environment.
"""

from __future__ import annotations

import ctypes
import os
import select
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from ..errors import format_value
from ..plugins.portable import unread
from ..plugins.processes import PR_SET_PDEATHSIG
from .protocol import StackFailedError

MAX_LINE = 1_000_000  #: Longest line that a stack may write [bytes].
TAIL = 4_000  #: Part of the standard error that is kept, its end [bytes].
SHOWN_LINES = 8  #: Number of last lines of the output in the reason of a failure.
TICK = 0.1  #: Longest time between two checks of a time limit [s].
GRACE = 1.0  #: Time that a stack has to end after its standard input is closed [s].
KILL_LIMIT = 5.0  #: Time that the system has to end killed processes [s].
#: Environment variable of all processes of a stack.
MARK = "VSCONSTRAINTS_STACK_PROCESS"
READ = 65_536  #: Largest number of bytes that are read at once.


class StackProcess:
    """A command that is asked and answers line by line.

    ``run_limit`` [s] limits the total time of waiting for it. Raises StackFailedError if the
    command cannot be started.
    """

    def __init__(self, command: Sequence[str], run_limit: float) -> None:
        self._run_limit = run_limit
        self._waited = 0.0
        self._received = b""
        self._errors = b""
        self._mark = uuid.uuid4().hex
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
                start_new_session=True,
                env={**os.environ, MARK: self._mark},
                preexec_fn=_ending_with_parent(),
            )
        except (OSError, ValueError) as error:
            raise StackFailedError(
                f"the command {format_value(list(command))} cannot be started: {error}"
            ) from error
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        self._process = process
        self._in = process.stdin.fileno()
        self._out = process.stdout.fileno()
        self._err = process.stderr.fileno()
        os.set_blocking(self._in, False)
        self._readable = select.poll()
        self._readable.register(self._out, select.POLLIN)
        self._readable.register(self._err, select.POLLIN)
        # the same, and room in the pipe to the stack
        self._writable = select.poll()
        self._writable.register(self._in, select.POLLOUT)
        self._writable.register(self._err, select.POLLIN)

    def ask(self, message: bytes, limit: float) -> bytes:
        """Write a line, and return the line that answers it within ``limit`` [s].

        Raises StackFailedError if there is no such line, if there was one already, or if the stack
        wrote one before it had read the question.
        """
        if self._received or self._ready(self._readable, 0.0, self._out):
            if not self._received:
                self._read()
            early = self._received[:200].decode("utf-8", "replace")
            raise StackFailedError(
                f"it wrote {early!r} before it was asked: standard output is for answers alone, "
                "everything else belongs on standard error"
            )
        self._write(message + b"\n", limit)
        line = self.line(limit)
        # a parser of JSON may leave the end of the line
        if unread(self._in) > 1:
            early = line[:200].decode("utf-8", "replace")
            raise StackFailedError(
                f"it wrote {early!r} before it had read what it was asked: one line answers one "
                "period"
            )
        return line

    def line(self, limit: float) -> bytes:
        """Return the next line, without its end; raises StackFailedError after ``limit`` [s]."""
        waited = self._waited
        while b"\n" not in self._received:
            if len(self._received) > MAX_LINE:
                raise StackFailedError(f"it wrote a line of more than {MAX_LINE} bytes")
            if self._ready(self._readable, TICK, self._out):
                self._read()
            # also after a part of a line, or a stack could write one byte after the other for ever
            self._check(waited, limit)
        line, _, self._received = self._received.partition(b"\n")
        return line

    def _write(self, message: bytes, limit: float) -> None:
        """Write all bytes; a stack that does not read blocks the pipe until the time limit."""
        waited = self._waited
        while message:
            try:
                message = message[os.write(self._in, message) :]
            except BlockingIOError:
                self._ready(self._writable, TICK, self._in)
                self._check(waited, limit)
            except OSError as error:
                raise StackFailedError(self._end() or "it closed its standard input") from error

    def _ready(self, poll: select.poll, seconds: float, wanted: int) -> bool:
        """Wait for at most ``seconds``; return True if the ``wanted`` descriptor is ready.

        Standard error that arrives is kept, and ends the wait early. The time counts, but at most
        ``seconds``: a longer time means that this process was stopped.
        """
        begun = time.monotonic()
        ready = [descriptor for descriptor, _ in poll.poll(1e3 * seconds)]
        if self._err in ready:
            self._read_errors()
        self._waited += min(time.monotonic() - begun, seconds)
        return wanted in ready

    def _check(self, waited_before: float, limit: float) -> None:
        """Raise StackFailedError if a time limit has passed."""
        if self._waited - waited_before > limit:
            raise StackFailedError(f"it gave no answer within {limit:g} s")
        if self._waited > self._run_limit:
            raise StackFailedError(f"the run had to wait for it more than {self._run_limit:g} s")

    def _read(self) -> None:
        data = os.read(self._out, READ)
        if not data:
            raise StackFailedError(self._end() or "it closed its standard output")
        self._received += data

    def _read_errors(self) -> None:
        """Read the standard error of the stack, and keep its end."""
        data = os.read(self._err, READ)
        self._errors = (self._errors + data)[-TAIL:]
        if not data:  # it is closed
            self._readable.unregister(self._err)
            self._writable.unregister(self._err)
            self._err = -1

    def _end(self) -> str:
        """Describe how the process has ended; empty if it does not end soon."""
        deadline = time.monotonic() + GRACE
        while not self._has_ended() and time.monotonic() < deadline:
            time.sleep(0.01)
        if not self._has_ended():
            return ""
        status = self._exit_status()
        if status is None or status.si_code == os.CLD_EXITED:
            code = "unknown" if status is None else status.si_status
            return f"it ended with the exit code {code}"
        return f"it was ended by the signal {signal.Signals(status.si_status).name}"

    def _has_ended(self) -> bool:
        """Return True if the process has ended."""
        return self._exit_status() is not None

    def _exit_status(self) -> os.waitid_result | None:
        """Return how the process has ended; None if it has not.

        This does not reap it: :meth:`end` does, after it has killed the group.
        """
        ended = os.WEXITED | os.WNOHANG | os.WNOWAIT
        return os.waitid(os.P_PID, self._process.pid, ended)

    def with_messages(self, reason: str) -> str:
        """Return a reason of a failure with the last lines of the stack's standard error."""
        while self._err >= 0 and len(self._errors) <= TAIL:
            poll = select.poll()
            poll.register(self._err, select.POLLIN)
            before = self._errors
            if not poll.poll(0):
                break
            self._read_errors()
            if len(before) == TAIL:  # it may write for ever
                break
        lines = [line for line in self._errors.decode("utf-8", "replace").splitlines() if line]
        said = " | ".join(lines[-SHOWN_LINES:])
        return f"{reason}; its last messages: {said}" if said else reason

    def end(self) -> str:
        """Let the process end, kill it with all that it has started, and release everything.

        Return a sentence if processes are left that cannot be killed; empty otherwise.
        """
        process = self._process
        streams = process.stdin, process.stdout, process.stderr
        if process.stdin is not None:
            process.stdin.close()
        deadline = time.monotonic() + GRACE
        # until it is reaped below, its number remains that of its group
        while not self._has_ended() and time.monotonic() < deadline:
            ready = [descriptor for descriptor, _ in self._readable.poll(10)]
            # a full pipe would keep it from ending
            if self._out in ready and not os.read(self._out, READ):
                self._readable.unregister(self._out)
                self._out = -1
            if self._err in ready:
                self._read_errors()
        with suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
        left = self._kill_others()
        for stream in streams:
            if stream is not None:
                stream.close()
        return left

    def _kill_others(self) -> str:
        """Kill the remaining processes of the stack in other groups, and wait for the stack.

        Return as :meth:`end`. A process that waits for a device cannot be killed before it answers.
        """
        deadline = time.monotonic() + KILL_LIMIT
        left = _marked(self._mark)
        while left and time.monotonic() < deadline:
            for number in left:
                with suppress(OSError):
                    os.kill(number, signal.SIGKILL)
            time.sleep(0.01)
            left = _marked(self._mark)
        try:
            self._process.wait(max(deadline - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            left = left or [self._process.pid]
        numbers = ", ".join(map(str, left))
        return f"processes {numbers} of the stack could not be killed" if left else ""


def _marked(mark: str) -> list[int]:
    """Return the ids of all processes with a mark in their environment; empty without /proc."""
    wanted = f"{MARK}={mark}".encode()
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        # it has ended, or is another user's
        with suppress(OSError):
            if wanted in (folder / "environ").read_bytes().split(b"\0"):
                found.append(int(folder.name))
    return found


def _ending_with_parent() -> Callable[[], object] | None:
    """Return a function that lets the system kill this process with its parent; None elsewhere."""
    if sys.platform != "linux":
        return None
    try:
        prctl = ctypes.CDLL(None).prctl
    except (OSError, AttributeError):
        return None
    return lambda: prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
