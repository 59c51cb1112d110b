"""The fuzz of the laws: a small share of it, and that it sees what it looks for."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checks import fuzz
from checks.inputs import Input, make_input

from vsconstraints.controllers import SlidingMode, Tracking
from vsconstraints.errors import InvalidInput
from vsconstraints.rows import Command, Rows, Task

ROOT = Path(__file__).resolve().parent.parent


def test_some_thousand_calls_find_nothing() -> None:
    found, outcomes = fuzz.fuzz(1, range(1000), limit=60.0)
    assert found == []
    assert sum(outcomes.values()) == 1000 * fuzz.EACH
    # all that there is was met with
    assert set(outcomes) >= {"ok", "relaxed", "rank-loss", "failed", "refused", "options refused"}
    assert min(outcomes[name] for name in ("ok", "relaxed", "rank-loss", "failed", "refused")) > 20


def test_the_same_seed_asks_the_same() -> None:
    for number in range(50):
        one, two = (make_input(np.random.default_rng((3, number))) for _ in range(2))
        assert pickle.dumps(one) == pickle.dumps(two)
    assert (
        len({pickle.dumps(make_input(np.random.default_rng((3, number)))) for number in range(50)})
        == 50
    )


def question() -> Input:
    rows = Rows(np.ones(1), np.eye(3)[:1], np.zeros(1), np.ones(1), ("row",))
    return Input(rows, Task(np.eye(3), np.ones(3)), sound=True)


def sound_command() -> Command:
    return SlidingMode().command(question().rows, question().task)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({}, ""),
        ({"status": "fine"}, "status"),
        ({"qdd": np.zeros(4)}, "shape"),
        ({"acted": np.zeros((1, 1), dtype=bool)}, "shape"),
        ({"slack": np.zeros(2)}, "shape"),
        ({"qdd": np.zeros(3, dtype=int)}, "type"),
        ({"qdd": np.full(3, np.nan)}, "finite"),
        ({"slack": np.full(1, np.inf)}, "finite"),
        ({"labels": ("other",)}, "labels"),
        ({"reason": "none"}, "reason"),
        ({"status": "relaxed"}, "reason"),
        ({"status": "failed", "reason": "why"}, "rest"),
    ],
)
def test_each_fault_of_a_command_is_seen(changes: dict[str, Any], word: str) -> None:
    assert fuzz.judge(replace(sound_command(), **changes), question()).partition(" of ")[0] == word


class Misbehaves(Tracking):
    """A law that is asked past its own checks."""

    def __init__(self, does: Any) -> None:
        super().__init__()
        self.does = does

    def define(self, rows: Rows, task: Task) -> Command:
        answer: Command = self.does(rows, task)
        return answer


def writes(rows: Rows, task: Task) -> Command:
    task.b[0] = 7.0
    return sound_command()


def raises(error: Exception) -> Any:
    def law(rows: Rows, task: Task) -> Command:
        raise error

    return law


@pytest.mark.parametrize(
    ("does", "sound", "outcome", "words"),
    [
        (lambda rows, task: sound_command(), True, "ok", ""),
        (lambda rows, task: sound_command(), None, "ok", ""),
        (
            lambda rows, task: sound_command(),
            False,
            "answered",
            "answered, though the input is none",
        ),
        (lambda rows, task: None, True, "answered", "None is no command"),
        (writes, True, "answered", "wrote into its input"),
        (raises(InvalidInput("no")), True, "refused", "refused, though sound: no"),
        (raises(InvalidInput("no")), False, "refused", ""),
        (raises(KeyError("slip")), False, "raised", "KeyError: 'slip'"),
        (raises(RuntimeWarning("overflow")), None, "raised", "RuntimeWarning: overflow"),
    ],
)
def test_each_misbehaviour_is_seen(does: Any, sound: bool | None, outcome: str, words: str) -> None:
    asked = replace(question(), sound=sound)
    assert fuzz.answers(Misbehaves(does), asked, "definition") == (outcome, words)


def stuck(sender: Any, now: Any) -> None:
    now[0] = 5
    time.sleep(600.0)


def dies(sender: Any, now: Any) -> None:
    sender.send(Counter(ok=3))
    os._exit(3)


@pytest.mark.parametrize(
    ("target", "why", "said"),
    [(stuck, "no end within 1 s", []), (dies, "the process ended with 3", [{"ok": 3}])],
)
def test_a_hang_and_a_crash_are_seen(target: Any, why: str, said: list[Any]) -> None:
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    now = context.RawArray("q", [0])
    worker = context.Process(target=target, args=(sender, now), daemon=True)
    worker.start()
    sender.close()
    assert fuzz.watch(worker, receiver, now, 1.0) == (why, said)
    assert not worker.is_alive()
    worker.close()


def test_the_command_prints_what_was_found(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    given: list[Any] = []

    def finds(seed: int, numbers: range) -> tuple[list[fuzz.Finding], Counter[str]]:
        given.append((seed, numbers))
        return [fuzz.Finding(7, "tracking {}", "compiled", "KeyError: 3")], Counter(ok=8)

    monkeypatch.setattr(fuzz, "fuzz", finds)
    assert fuzz.main(["--calls", "10", "--seed", "4"]) == 1
    assert fuzz.main(["--inputs", "7:8"]) == 1
    assert given == [(4, range(3)), (0, range(7, 8))]
    assert "input 7 of seed 4, tracking {}, compiled: KeyError: 3" in capsys.readouterr().out
    monkeypatch.setattr(fuzz, "fuzz", lambda seed, numbers: ([], Counter(ok=8)))
    assert fuzz.main([]) == 0
