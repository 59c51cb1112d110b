"""``python -m checks.fuzz [--calls N] [--seed S] [--inputs FIRST:LAST]``: laws with any input.

Every registered controller, compiled and not, is given random, extreme, degenerate and malformed
input. It must end within a time limit: with a finite command of a known status, or with an error of
this package. Failures are printed with the input's number; then the exit code is 1. The same seed
gives the same inputs.

The calls run in a separate process, because otherwise an endless loop within a library could not be
ended. This process watches it, and continues after an input that does not end.
"""

from __future__ import annotations

import argparse
import inspect
import multiprocessing
import sys
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from time import perf_counter
from typing import Any, get_args

import numpy as np

from vsconstraints.controllers import CONTROLLERS, DEMANDS, RESOLVERS, Controller, make_controller
from vsconstraints.controllers.base import restart
from vsconstraints.errors import VsconstraintsError
from vsconstraints.rows import Command, Status

from .inputs import OPTIONS, ROWS, TASK, WRONG_OPTIONS, Input, make_input

EACH = 4
"""Number of laws that are called with the same input."""

DEFINITION = 0.3
"""Share of the calls to the form that is not compiled."""

LIMIT = 20.0
"""Time limit of the calls on one input [s]; milliseconds are usual on an idle machine."""

PERIOD = 0.01
"""Sampling period of the laws [s]."""

PATIENCE = 600.0
"""Time limit of the first answer [s]: compiling all demands and resolvers takes long."""

LAWS = tuple(name for name in CONTROLLERS if "model" not in make_controller(name).uses)
"""Laws that need only rows and a task."""


@dataclass(frozen=True)
class Finding:
    """Failure of a law.

    Attributes
    ----------
    number
        Number of the input.
    law, form
        Law, and its form.
    what
        Description of the failure.
    """

    number: int
    law: str
    form: str
    what: str


def main(arguments: Sequence[str] | None = None) -> int:
    """Call laws and print failures; return 1 if there are any."""
    parser = argparse.ArgumentParser(prog="python -m checks.fuzz", description="Ask laws anything.")
    parser.add_argument(
        "--calls", type=int, default=1_000_000, help="how many calls of laws (default: 1000000)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of all inputs (default: 0)")
    parser.add_argument(
        "--inputs", default="", help="FIRST:LAST, only these inputs: to see a finding again"
    )
    chosen = parser.parse_args(arguments)
    first = 0
    last = -(-chosen.calls // EACH)
    if chosen.inputs:
        first, last = (int(part) for part in chosen.inputs.split(":"))
    started = perf_counter()
    found, outcomes = fuzz(chosen.seed, range(first, last))
    seconds = perf_counter() - started
    calls = sum(outcomes.values())
    for finding in found:
        print(
            f"input {finding.number} of seed {chosen.seed}, {finding.law}, {finding.form}: "
            f"{finding.what}"
        )
    said = ", ".join(f"{number} {outcome}" for outcome, number in sorted(outcomes.items()))
    print(
        f"{calls} calls in {seconds:.0f} s, {calls / seconds:.0f} a second: {said}; {len(found)} "
        f"findings"
    )
    return 1 if found else 0


def fuzz(seed: int, numbers: range, limit: float = LIMIT) -> tuple[list[Finding], Counter[str]]:
    """Call laws in a separate process, restarted if it ends early.

    Returns failures, and the number of calls by outcome.
    """
    found: list[Finding] = []
    outcomes: Counter[str] = Counter()
    context = multiprocessing.get_context("spawn")
    at = numbers.start
    while at < numbers.stop:
        receiver, sender = context.Pipe(duplex=False)
        # a worker that is killed must not hold a lock: this array has none
        now = context.RawArray("q", [at - 1])
        worker = context.Process(
            target=ask, args=(seed, range(at, numbers.stop), sender, now), daemon=True
        )
        worker.start()
        sender.close()
        why, answers = watch(worker, receiver, now, limit)
        for answer in answers:
            if isinstance(answer, Finding):
                found.append(answer)
            else:
                outcomes.update(answer)
        at = int(now[0]) + 1
        if why:
            found.append(Finding(int(now[0]), "some law", "either form", why))
    return found, outcomes


def watch(
    worker: Any, receiver: Connection, now: Any, limit: float
) -> tuple[str, list[Finding | Counter[str]]]:
    """Wait until the process ends or hangs; return why it ended early, and its messages."""
    answers: list[Finding | Counter[str]] = []
    before = int(now[0])
    since = perf_counter()
    patience = PATIENCE
    why = ""
    while True:
        try:
            while receiver.poll(0.2):
                answers.append(receiver.recv())
        except (EOFError, OSError):
            worker.join()
            return (
                "" if worker.exitcode == 0 else f"the process ended with {worker.exitcode}"
            ), answers
        if int(now[0]) != before:
            before = int(now[0])
            since = perf_counter()
            patience = limit
        elif perf_counter() - since > patience:
            why = f"no end within {patience:.0f} s"
            worker.kill()
            worker.join()
            return why, answers


def ask(seed: int, numbers: range, sender: Connection, now: Any) -> None:
    """Call laws with these inputs; ``now`` holds the number of the present one."""
    warnings.simplefilter("error", RuntimeWarning)
    warm_up()
    outcomes: Counter[str] = Counter()
    for number in numbers:
        now[0] = number
        for finding in findings(seed, number, outcomes):
            sender.send(finding)
        if number % 500 == 0:
            sender.send(outcomes)
            outcomes = Counter()
    sender.send(outcomes)
    sender.close()


def warm_up() -> None:
    """Compile all laws, which may exceed the time limit."""
    sound = make_input(np.random.default_rng(0))
    while not sound.sound:
        sound = make_input(np.random.default_rng(1))
    pairs = [{"demand": demand.name, "resolver": "filter"} for demand in DEMANDS]
    pairs += [{"demand": "switch", "resolver": resolver.name} for resolver in RESOLVERS]
    for name, options in (*((name, {}) for name in LAWS), *(("law", pair) for pair in pairs)):
        ready(name, options).command(sound.rows, sound.task)


def ready(name: str, options: dict[str, Any]) -> Controller:
    """Return the law of a given name, with a sampling period."""
    law = make_controller(name, options)
    restart(law, PERIOD)
    return law


def findings(seed: int, number: int, outcomes: Counter[str]) -> Iterator[Finding]:
    """Call some laws with one input; yield failures."""
    rng = np.random.default_rng((seed, number))
    with np.errstate(over="ignore", under="ignore"):
        question = make_input(rng)
    for _ in range(EACH):
        name = str(rng.choice(list(LAWS)))
        options = OPTIONS[name](rng) if name in OPTIONS else {}
        if rng.random() < 0.2:
            options["rank_tolerance"] = float(10.0 ** rng.uniform(-17.0, -0.01))
        form = "definition" if rng.random() < DEFINITION else "compiled"
        law = f"{name} {options}"
        if rng.random() < 0.02:
            outcome, what = refuses(name, options, rng)
        else:
            try:
                asked = ready(name, options)
            except VsconstraintsError:  # a parameter outside the range of its demand
                outcome = "options refused"
                what = ""
            else:
                outcome, what = answers(asked, question, form)
        outcomes[outcome] += 1
        if what:
            yield Finding(number, law, form, what)


def refuses(name: str, options: dict[str, Any], rng: np.random.Generator) -> tuple[str, str]:
    """Give one option a wrong value; return the outcome, and the failure, if any."""
    option = str(rng.choice(list(inspect.signature(CONTROLLERS[name]).parameters)))
    value = WRONG_OPTIONS[int(rng.integers(len(WRONG_OPTIONS)))]
    try:
        make_controller(name, {**options, option: value})
    except VsconstraintsError as error:
        text = str(error)
        return "options refused", f"{option} = {value!r}: {text}" if "np.float64" in text else ""
    except Exception as error:  # any other error is a finding
        return "raised", f"{option} = {value!r}: {type(error).__name__}: {error}"
    return "options accepted", ""


def answers(law: Controller, question: Input, form: str) -> tuple[str, str]:
    """Call a law; return the outcome, and the failure, if any."""
    before = [getattr(question.rows, name, None) for name in ROWS] + [
        getattr(question.task, name, None) for name in TASK
    ]
    kept = [
        array.tobytes() if isinstance(array, np.ndarray) and array.dtype != object else None
        for array in before
    ]
    call = law.command if form == "compiled" else law.define
    try:
        command: object = call(question.rows, question.task)
    except VsconstraintsError as error:
        return "refused", f"refused, though sound: {error}" if question.sound else ""
    except Exception as error:  # any other error is a finding
        return "raised", f"{type(error).__name__}: {error}"
    if question.sound is False:
        return "answered", "answered, though the input is none"
    for array, bytes_before in zip(before, kept, strict=True):
        if isinstance(array, np.ndarray) and bytes_before not in (None, array.tobytes()):
            return "answered", "wrote into its input"
    wrong = judge(command, question)
    return (command.status if isinstance(command, Command) and not wrong else "answered"), wrong


def judge(command: object, question: Input) -> str:
    """Describe the errors of a command; empty if it is correct."""
    if not isinstance(command, Command):
        return f"{command!r} is no command"
    n = question.task.J.shape[1]
    m = len(question.rows.labels)
    qdd = command.qdd
    acted = command.acted
    slack = command.slack
    checks = {
        "status": command.status in get_args(Status),
        "shape": qdd.shape == (n,)
        and acted.shape == (m,)
        and (slack is None or slack.shape == (m,)),
        "type": qdd.dtype == np.float64 and acted.dtype == np.bool_,
        "finite": bool(np.isfinite(qdd).all() and (slack is None or np.isfinite(slack).all())),
        "labels": command.labels == question.rows.labels,
        "reason": (command.status == "ok") == (command.reason == ""),
        "rest": command.status != "failed" or not qdd.any(),
    }
    return ", ".join(f"{what} of {command}" for what, holds in checks.items() if not holds)


if __name__ == "__main__":
    sys.exit(main())
