"""A process that stops the arm where this one no longer can: killed, suspended, or with its
interpreter held.
"""

from __future__ import annotations

import os
import pickle
import select
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress

from ..errors import ConfigurationError, described
from ..plugins import portable
from ..plugins.processes import SIGNALS

ATTEMPTS = 3  #: How often a stop command is tried.
START_S = 60.0  #: How long the process may take to be ready, while the arm stands, and to end [s].
END_S = 10.0
#: How long the process may leave heartbeats unanswered [s], its patience if that is longer: one
#: that is suspended would not stop the arm. It may wait for the processor for a while.
ANSWER_S = 1.0
ANSWER = b"\n"  #: To each heartbeat, or several at once: no text of a report.
#: A message: for how many seconds it may be the last one [s]; negative if the arm is at rest.
HEARTBEAT = struct.Struct("<d")

CODE = """
import pickle, sys
sys.path[:] = pickle.load(sys.stdin.buffer)
from vsconstraints.arms.guardian import watch
watch()
"""


class Guardian:
    """Stops an arm from a process of its own, unless heartbeats come at least every ``patience``
    [s].

    It has its own connection to the arm and nothing in common with this process, whose end it sees
    as silence. It answers heartbeats, so that this process sees where it has ended or does not go
    on. Signals of the terminal do not reach it. ``stop`` is of :meth:`.Driver.stopper`. Raises
    ConfigurationError if the process cannot be started, or cannot use it.
    """

    def __init__(self, stop: Callable[[], None], patience: float) -> None:
        self.patience = patience
        #: Why the other process would not stop the arm: it has ended by itself, or does not answer.
        self.lost = ""
        self._said = b""  #: What it has said beside answers.
        #: When the oldest heartbeat without an answer was sent [s].
        self._unanswered: float | None = None
        pipe = subprocess.PIPE
        words = [sys.executable, "-c", CODE]
        self.process = subprocess.Popen(
            words, stdin=pipe, stdout=pipe, bufsize=0, start_new_session=True
        )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self._to = self.process.stdin
        self._from = self.process.stdout
        try:
            self._to.write(pickle.dumps(sys.path) + pickle.dumps(stop))
            answer = self._from.read(1) if select.select([self._from], [], [], START_S)[0] else b""
        except (OSError, pickle.PicklingError, AttributeError) as error:
            self.end(True)
            raise ConfigurationError(
                f"what stops the arm cannot be given to another process: {error}"
            ) from error
        if answer != b"+":
            self.end(True)
            raise ConfigurationError(
                "the process that would stop the arm does not start: its error is above"
            )
        # where it no longer reads or writes, this process must not wait for it
        os.set_blocking(self._to.fileno(), False)
        os.set_blocking(self._from.fileno(), False)

    def alive(self, more: float = 0.0) -> None:
        """A heartbeat; the next one may take so much more time than usual [s]. Answers to earlier
        ones are read.
        """
        now = time.monotonic()
        try:
            # None where there is none yet, and nothing where the process has ended
            answers = self._from.read(1 << 16)
            if answers is not None:
                self._unanswered = None
                self._said += answers.strip(ANSWER)
            if answers == b"":
                self.lost = "has ended"
            # nothing is written, nor raised, where the pipe is full
            if not self._to.write(HEARTBEAT.pack(self.patience + more)):
                self.lost = self.lost or "does not read"
        except OSError:
            self.lost = "has ended"
        if self._unanswered is None:
            self._unanswered = now
        elif now - self._unanswered > max(self.patience, ANSWER_S):
            self.lost = self.lost or f"has not answered for {now - self._unanswered:.3g} s"

    def end(self, safe: bool) -> str:
        """End it; returns what it has done, if anything. Unless the arm is ``safe``, it stops it
        now.
        """
        with suppress(OSError):
            if safe:
                self._to.write(HEARTBEAT.pack(-1.0))
        with suppress(OSError):
            self._to.close()
        try:
            # one that does not answer is not waited for where it has nothing to do
            self.process.wait(0.1 if self.lost and safe else END_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        os.set_blocking(self._from.fileno(), True)
        with self._from:
            said: bytes = self._said + self._from.read()
        return said.decode(errors="replace").strip()


def watch() -> None:
    """What the process does: wait for heartbeats and, where they fail to come, stop the arm."""
    for number in (*SIGNALS, *portable.signals("SIGPIPE")):
        signal.signal(number, signal.SIG_IGN)
    stop = pickle.load(sys.stdin.buffer)
    os.write(1, b"+")
    # the watched process may be held, and then reads no answers
    os.set_blocking(1, False)
    patience: float | None = None
    while select.select([0], [], [], patience)[0]:
        messages = os.read(0, 1 << 16)
        if not messages and patience is None:  # nothing was sent to the arm yet
            return
        if not messages:
            why = "the loop has ended"
            break
        (patience,) = HEARTBEAT.unpack(messages[-HEARTBEAT.size :])
        if not patience >= 0.0:
            return
        with suppress(OSError):
            os.write(1, ANSWER)
    else:
        why = f"the loop has said nothing for {1e3 * (patience or 0.0):g} ms"
    how = ""
    for _ in range(ATTEMPTS):
        try:
            stop()
            how = "told the arm to stop by its own means"
            break
        except BaseException as error:  # a driver's own mistake must not prevent another try
            how = f"COULD NOT TELL THE ARM TO STOP ({described(error)})"
    for file in (1, 2):  # the watched process, and whoever started it, as far as they still run
        with suppress(OSError):
            os.write(file, f"{why}, and a process of its own {how}\n".encode())
