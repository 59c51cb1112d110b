"""Stacks in processes of their own: any program that speaks the protocol of docs/stacks.md."""

from __future__ import annotations

import ast
import math
import re
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from ..controllers.ranges import positive_number
from ..errors import ConfigurationError, format_value, one_line, unknown_name
from ..simulation.programs import Answer, Observation, program_name
from ..simulation.setup import Setup
from .child import StackProcess
from .protocol import (
    MAX_TEXT,
    StackFailedError,
    checked_declaration,
    encode,
    read_declaration,
    read_reply,
    require_settings_of_json,
    undeclared,
)
from .stack import MeasuredProgram

START_LIMIT = 60.0  #: Time until the declaration, and until the first answer [s].
REPLY_LIMIT = 1.0  #: Time until every other answer [s].
RUN_LIMIT = 120.0  #: Total time that a run waits for its stack [s].
LONGEST_START = 300.0  #: Greatest ``start_time`` of a stack [s].
COARSE = 0.02  #: Largest error of the clock by which a stack measures its computation [s].
#: End of the last messages of a program in Python that has used a key that is not there.
MISSING_KEY = re.compile(r"KeyError: '(\w+)'$")
ADAPTERS = Path(__file__).parent / "adapters"  #: Folder of the adapters, one program each.


def adapters() -> list[str]:
    """Return the names of the adapters that come with the package."""
    return sorted(path.stem.removesuffix("_stack") for path in ADAPTERS.glob("*_stack.py"))


def description(adapter: str) -> str:
    """Return the first line of an adapter's description."""
    tree = ast.parse((ADAPTERS / f"{adapter}_stack.py").read_text(encoding="utf-8"))
    return (ast.get_docstring(tree) or "").partition("\n")[0]


class ExternalStack(MeasuredProgram):
    """Program that runs in a separate process and answers over its standard output.

    The process starts with each run and ends with it. Limits of time apply to waiting for the
    stack; the time that it computes is what it reports itself.

    Parameters
    ----------
    command
        Program and arguments, as a list or as one text that is split like in a shell.
    adapter
        Name of an adapter that comes with the package, instead of a command.
    python
        Interpreter of the environment of the adapter's package; that of this process if None.
    start_time
        Time until the declaration, and until the first answer [s], for a stack that takes longer
        to start than :data:`START_LIMIT`; at most :data:`LONGEST_START`. Results name it.
    settings
        Any other option is passed on to the stack.

    Raises
    ------
    ConfigurationError
        unless exactly one of command and adapter is given, if the adapter is unknown, or if JSON
        does not have a setting or ``start_time`` is not allowed.
    """

    name = "external-stack"
    uses = ("measurements",)

    def __init__(
        self,
        command: Sequence[str] | str = (),
        adapter: str | None = None,
        python: str | None = None,
        start_time: float | None = None,
        **settings: Any,
    ) -> None:
        # not an attribute ``command``, which is a method of controllers
        self._command = command
        self.adapter = adapter
        self.python = python
        self.start_time = None if start_time is None else _checked_start(start_time)
        self.settings = settings
        require_settings_of_json(settings)
        self._arguments = _arguments(command, adapter, python)
        self._process: StackProcess | None = None
        self._left = ""
        self._uses: tuple[str, ...] = ()
        self._overstated = 0  # periods whose reported time is longer than the answer took

    def begin(self, setup: Setup) -> None:
        """Start the process and send it the setup; see :class:`.RobotProgram`."""
        super().begin(setup)
        self._left = ""
        self._uses = ()
        self._overstated = 0
        # both the declaration and the first answer may take as long as a start
        more = 2.0 * max(self._start_limit - START_LIMIT, 0.0)
        self._process = process = StackProcess(self._arguments, RUN_LIMIT + more)
        try:
            declaration = read_declaration(process.line(self._start_limit))
            uses, self.output = checked_declaration(declaration.uses, declaration.output)
        except StackFailedError as error:
            raise StackFailedError(process.with_messages(str(error))) from error
        self._uses = uses
        named = one_line(declaration.name, MAX_TEXT) or program_name(self._arguments)
        # the setup is sent with the first period, whose answer may take as long as a start
        self._setup = encode(self.prepare(setup, named, uses, self.settings)) + b"\n"

    def respond(self, now: Observation) -> Answer:
        """Ask the process for the command of a period; see :class:`.RobotProgram`."""
        assert self._process is not None
        message = self._setup + encode(self._measured(now))
        limit = self._start_limit if self._setup else REPLY_LIMIT
        asked = perf_counter()
        try:
            line = self._process.ask(message, limit)
            took = perf_counter() - asked
            answer = read_reply(line, self.output, self._n, now.t)
        except StackFailedError as error:
            reason = self._process.with_messages(str(error))
            raise StackFailedError(f"{reason}{self._undeclared(reason)}") from error
        self._setup = b""
        return self.counted(self._plausible(answer, took))

    def end(self) -> None:
        """End the process and all that it has started; see :class:`.RobotProgram`."""
        if self._process is not None:
            self._left = self._process.end()
            self._process = None

    def run_remarks(self) -> list[str]:
        """Return remarks: declaration, missing answers, times, and remaining processes.

        The times are the one allowed to start, and computing times that are left out.
        """
        start = "" if self.start_time is None else f"it was allowed {self.start_time:g} s to start"
        times = ""
        if self._overstated:
            times = (
                f"its compute_s is left out in {self._overstated} periods, in which it was longer "
                "than its answer took: it is wall time in seconds"
            )
        texts = *super().run_remarks(), start, times, self._left
        return [text for text in texts if text]

    @property
    def _start_limit(self) -> float:
        """Time until the declaration, and until the first answer [s]."""
        return START_LIMIT if self.start_time is None else self.start_time

    def _plausible(self, answer: Answer, took: float) -> Answer:
        """Return an answer that took ``took`` [s], without its computing time if that is longer."""
        if answer.compute_time > took + COARSE:
            self._overstated += 1
            return answer._replace(compute_time=math.nan)
        return answer

    def _undeclared(self, reason: str) -> str:
        """Return what the stack should declare if it ended for a lack of it; empty otherwise."""
        missing = MISSING_KEY.search(reason)
        wrong = undeclared(missing[1], self._uses) if missing else ""
        return f"; it {wrong}" if wrong else ""

    def __repr__(self) -> str:
        return f"<ExternalStack {shlex.join(self._arguments)}>"

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_process": None}


def _checked_start(value: object) -> float:
    seconds = positive_number("start_time", value)
    if seconds > LONGEST_START:
        raise ConfigurationError(
            f"start_time is at most {LONGEST_START:g} s, not {format_value(value)}"
        )
    return seconds


def _arguments(command: Sequence[str] | str, adapter: str | None, python: str | None) -> list[str]:
    """Return program and arguments; raises as :class:`ExternalStack`."""
    if bool(command) == (adapter is not None):
        raise ConfigurationError(
            'a stack has either a command, ["python3", "my_stack.py"], or an adapter: '
            f"{', '.join(adapters())}"
        )
    if adapter is not None:
        if adapter not in adapters():
            raise unknown_name("adapter", adapter, adapters())
        return [python or sys.executable, str(ADAPTERS / f"{adapter}_stack.py")]
    if python is not None:
        raise ConfigurationError("python is the interpreter of an adapter; a command names its own")
    try:
        parts = shlex.split(command) if isinstance(command, str) else list(command)
    except ValueError as error:
        raise ConfigurationError(f"the command of a stack, {command!r}: {error}") from error
    if not parts or not all(isinstance(part, str) and part for part in parts):
        raise ConfigurationError(
            f"the command of a stack must be a list of texts, not {format_value(command)}"
        )
    return parts
