"""Laws that are defined in a session: copies have the globals of the moment, and results are found
again later.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from vsconstraints import compare
from vsconstraints.errors import ConfigurationError
from vsconstraints.scenarios import Scenario
from vsconstraints.view.notebooks.copies import copied, stable_digest
from vsconstraints.view.notebooks.inputs import spec_of

pytest.importorskip("cloudpickle")

#: Run as a script, whose classes are those of no module, as in a notebook.
CELL = """
import sys, warnings
from vsconstraints import compare, run
from vsconstraints.controllers import Tracking
from vsconstraints.view.notebooks.inputs import spec_of
from vsconstraints.scenarios import Scenario

GAIN = 1.0
BRIEF = Scenario.load("example-2d-fov").with_override("duration", 0.05)
class Own(Tracking):
    name = "own"
    def solve(self, rows, task):
        command = super().solve(rows, task)
        if "some" in {"some", "others", "and", "more"}:
            command.qdd *= GAIN
        return command
"""

GLOBALS = (
    CELL
    + """
def accelerations(): return run(BRIEF, Own()).trajectory.qdd_command
def compared(): return compare(Own(), BRIEF, workers=WORKERS, progress=False).run("own").trajectory.qdd_command
for WORKERS in (0, 1):
    GAIN = 1.0
    one, first, digest = accelerations(), compared(), spec_of(Own())[0].options
    GAIN = 0.0
    none, second = accelerations(), compared()
    assert one.any() and not none.any(), "a run does not use the present value"
    assert first.any() and not second.any(), f"a comparison with {WORKERS} workers does not use the present value"
    assert spec_of(Own())[0].options != digest
print("as it is now")
"""
)

AGAIN = (
    CELL
    + """
done = compare(Own(), BRIEF, workers=0, progress=False, out=sys.argv[1])
print(spec_of(Own())[0].options["instance"])
"""
)


def session(code: str, *arguments: str, seed: str = "0") -> str:
    """What code prints that is run in a session of its own."""
    environment = {**os.environ, "PYTHONHASHSEED": seed}
    command = [sys.executable, "-c", f"if __name__ == '__main__':\n    exec({code!r})", *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_a_law_of_a_session_uses_the_present_values_of_its_globals() -> None:
    assert session(GLOBALS) == "as it is now"


def test_a_comparison_goes_on_in_another_session(tmp_path: Path) -> None:
    """Names of classes, cells and the order of sets differ from session to session, the law does
    not.
    """
    out = tmp_path / "out"
    digest = session(AGAIN, str(out), seed="1")
    stored = {path.name: path.stat().st_mtime_ns for path in (out / "trajectories").iterdir()}
    assert session(AGAIN, str(out), seed="2") == digest
    assert {
        path.name: path.stat().st_mtime_ns for path in (out / "trajectories").iterdir()
    } == stored


def test_another_comparison_in_the_folder_is_told_in_the_words_of_a_session(tmp_path: Path) -> None:
    brief = Scenario.load("example-2d-fov").with_override("duration", 0.05)
    compare("sliding-mode", brief, workers=0, progress=False, out=tmp_path)
    with pytest.raises(
        ConfigurationError, match=r"holds another comparison.*: give another folder as out=…"
    ) as told:
        compare(
            "tracking",
            brief.with_override("duration", 0.06),
            workers=0,
            progress=False,
            out=tmp_path,
        )
    assert "--" not in str(told.value)


@pytest.mark.parametrize(
    "value", [2.0, (1.0, 2.0), {"a": 1}, {"b"}, frozenset({3}), "text", b"bytes", [[1], [2]]]
)
def test_laws_that_hold_something_else_have_another_digest(value: object) -> None:
    import cloudpickle

    def digest(held: object) -> str:
        return stable_digest(cloudpickle.dumps({"held": held, "more": [held, (held,)]}))

    assert digest(value) == digest(value)
    others = [1.0, (2.0, 1.0), {"a": 2}, {"c"}, frozenset({4}), "texts", b"byte", [[2], [1]]]
    assert digest(value) not in [digest(other) for other in others]


def test_texts_of_a_law_that_look_like_numbers_of_classes_count() -> None:
    import cloudpickle

    texts = [
        "0123456789ab4cde8f0123456789abcd",
        "fedcba9876544321a0fedcba98765432",
        "runs/ipykernel_1/2.py",
        "runs/ipykernel_1/3.py",
        "<ipython-input-a>",
        "<ipython-input-b>",
    ]
    digests = {stable_digest(cloudpickle.dumps({"file": text})) for text in texts}
    assert len(digests) == len(texts)


def test_a_copy_shares_code_and_nothing_else() -> None:
    from vsconstraints.controllers import Tracking

    law = Tracking()
    # type: ignore[attr-defined]
    law.own = [1]
    law.function = max
    law.module = os
    copy = copied(law)
    assert type(copy) is Tracking
    assert copy.own == [1]  # type: ignore[attr-defined]
    assert copy.own is not law.own  # type: ignore[attr-defined]
    assert copy.function is max  # type: ignore[attr-defined]
    assert copy.module is os  # type: ignore[attr-defined]


def test_a_spec_is_sent_without_the_law_itself() -> None:
    import pickle

    from vsconstraints.controllers import SlidingMode, Tracking

    law = Tracking()
    law.solve = SlidingMode().solve  # type: ignore[method-assign]
    spec, note = spec_of(law, "own")
    assert not note
    sent = pickle.loads(pickle.dumps(spec))
    assert (spec.instance, sent.instance) == (law, None)  # type: ignore[attr-defined]
    assert type(sent.make()) is type(spec.make()) is Tracking
