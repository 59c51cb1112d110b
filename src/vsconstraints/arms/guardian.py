"""Guardian: a process that stops the arm when this process no longer can.

This process may be killed, suspended, or blocked with its interpreter lock held.
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

ATTEMPTS = 3  #: Number of attempts to send a stop command.
#: Time limits [s]: for the start of the process, while the arm stands, and for its end.
START_S = 60.0
END_S = 10.0
#: Time for which heartbeats may remain unanswered [s], or the patience if that is longer: a
#: suspended guardian would not stop the arm. The guardian may wait for the processor for a while.
ANSWER_S = 1.0
ANSWER = b"\n"  #: Answer to one or more heartbeats; it is not part of a report.
#: Heartbeat: time within which the next one must follow [s]; negative if the arm is at rest.
HEARTBEAT = struct.Struct("<d")

CODE = """
import pickle, sys
sys.path[:] = pickle.load(sys.stdin.buffer)
from vsconstraints.arms.guardian import watch
watch()
"""


class Guardian:
    """Stops an arm from a separate process unless heartbeats arrive every ``patience`` [s].

    The process has its own connection to the arm and shares nothing with this process, whose end it
    notices by missing heartbeats. It answers heartbeats, so that this process notices if it has
    ended or hangs. Signals of the terminal do not reach it. ``halt`` is returned by
    :meth:`.Driver.stopper`. Raises ConfigurationError if the process cannot be started, or cannot
    use ``halt``.
    """

    def __init__(self, halt: Callable[[], None], patience: float) -> None:
        self.patience = patience
        #: Reason why the guardian cannot stop the arm: it has ended, or does not answer. Empty if
        #: it can.
        self.lost = ""
        self._said = b""  #: Output of the process besides answers.
        #: Time at which the oldest unanswered heartbeat was sent [s].
        self._unanswered: float | None = None
        try:
            message = pickle.dumps(sys.path) + pickle.dumps(halt)
        except Exception as error:  # custom objects can fail in any way
            raise ConfigurationError(
                "the driver that stops the arm cannot be sent to the guardian process: "
                f"{described(error)}"
            ) from error
        pipe = subprocess.PIPE
        words = [sys.executable, "-c", CODE]
        try:
            self.process = subprocess.Popen(
                words, stdin=pipe, stdout=pipe, bufsize=0, start_new_session=True
            )
        except OSError as error:
            raise ConfigurationError(
                "the guardian process, which stops the arm if the loop cannot, does not start: "
                f"{error}"
            ) from error
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self._to = self.process.stdin
        self._from = self.process.stdout
        try:
            self._to.write(message)
            answer = self._from.read(1) if select.select([self._from], [], [], START_S)[0] else b""
        except OSError as error:
            self.end(True)
            raise ConfigurationError(
                f"the driver that stops the arm cannot be sent to the guardian process: {error}"
            ) from error
        if answer != b"+":
            self.end(True)
            raise ConfigurationError(
                "the guardian process, which stops the arm if the loop cannot, does not start: "
                "its error is above"
            )
        # a guardian that no longer reads or writes must not block this process
        os.set_blocking(self._to.fileno(), False)
        os.set_blocking(self._from.fileno(), False)

    def alive(self, more: float = 0.0) -> None:
        """Send a heartbeat and read the answers to earlier ones.

        The next heartbeat may take ``more`` seconds longer than usual.
        """
        now = time.monotonic()
        try:
            # None if nothing has arrived yet; empty if the process has ended
            answers = self._from.read(1 << 16)
            if answers is not None:
                self._unanswered = None
                self._said += answers.strip(ANSWER)
            if answers == b"":
                self.lost = "has ended"
            # if the pipe is full, write returns None and does not raise
            if not self._to.write(HEARTBEAT.pack(self.patience + more)):
                self.lost = self.lost or "does not read what the loop sends"
        except OSError:
            self.lost = "has ended"
        if self._unanswered is None:
            self._unanswered = now
        elif now - self._unanswered > max(self.patience, ANSWER_S):
            self.lost = self.lost or f"has not answered for {now - self._unanswered:.3g} s"

    def end(self, safe: bool) -> str:
        """End the process and return its report, if any.

        Unless the arm is ``safe``, the process stops it now.
        """
        with suppress(OSError):
            if safe:
                self._to.write(HEARTBEAT.pack(-1.0))
        with suppress(OSError):
            self._to.close()
        try:
            # do not wait for a process that does not answer and has nothing to do
            self.process.wait(0.1 if self.lost and safe else END_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        os.set_blocking(self._from.fileno(), True)
        with self._from:
            output: bytes = self._said + self._from.read()
        return output.decode(errors="replace").strip()


def watch() -> None:
    """Main function of the process: wait for heartbeats and stop the arm if they fail to arrive."""
    for number in (*SIGNALS, *portable.signals("SIGPIPE")):
        signal.signal(number, signal.SIG_IGN)
    halt = pickle.load(sys.stdin.buffer)
    os.write(1, b"+")
    # a suspended parent reads no answers
    os.set_blocking(1, False)
    patience: float | None = None
    while select.select([0], [], [], patience)[0]:
        messages = os.read(0, 1 << 16)
        if not messages and patience is None:  # nothing has been sent to the arm yet
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
        why = f"the loop has sent nothing for {1e3 * (patience or 0.0):g} ms"
    how = ""
    for _ in range(ATTEMPTS):
        try:
            halt()
            how = "sent the arm its stop command"
            break
        except BaseException as error:  # an error of the driver must not prevent another attempt
            how = f"COULD NOT SEND THE ARM ITS STOP COMMAND ({described(error)})"
    for file in (1, 2):  # to the watched process and to the terminal, if they still exist
        with suppress(OSError):
            os.write(file, f"{why}, and the guardian process {how}\n".encode())
