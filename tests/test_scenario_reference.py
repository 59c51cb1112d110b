"""The reference of scenario files names every key the loader knows, with its type and default, and
no other.
"""

from __future__ import annotations

import inspect
import re
import tomllib
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, get_args, get_origin

import msgspec
import numpy as np
import pytest

from documents import DOCS, blocks, reader_folder, run
from vsconstraints import Camera, Robot
from vsconstraints.constraints import Curve
from vsconstraints.constraints.curves import SHAPES
from vsconstraints.dynamics import ArmDynamics, Friction, Payload, Rods
from vsconstraints.images.settings import ImageSettings
from vsconstraints.robots.geometry import Pose
from vsconstraints.robots.kinematics import RobotPoint
from vsconstraints.robots.limits import ActuatorLimits
from vsconstraints.scenarios import CONSTRAINTS, SHIPPED, build, constraint_types, views
from vsconstraints.scenarios.reading import parameters, placed
from vsconstraints.simulation import Setup, Tolerances
from vsconstraints.simulation.disturbances import Disturbances
from vsconstraints.simulation.follower import ArmInput
from vsconstraints.vision.distortion import Distortion
from vsconstraints.vision.features import FEATURES
from vsconstraints.vision.motion import Motion
from vsconstraints.vision.tracking import Rest, TrackingGains, VisualTask

PAGE = DOCS / "scenarios.md"
KEY = re.compile(r"^- ((?:`\w+`(?:, )?)+) \(([^`,()]+)(?:, ([^()]+))?\):", flags=re.M)
"""A line of the reference: keys, type, and the default or that the key is required, if there is
one.
"""

TABLES_OF: dict[str, tuple[Callable[..., Any], ...]] = {
    "": (build.File,),
    "robot": (Robot.from_urdf, Robot.from_dh),
    "camera": (Camera, views.Places, Camera.from_calibration),
    **{f"camera.{place}": (views.pose_from,) for place in parameters(views.Places)},
    "camera.distortion": (Distortion,),
    "target.square": (build.Square,),
    "target.motion": (Motion, build.Turn),
    "task": (*FEATURES.values(), TrackingGains, VisualTask),
    "task.rest": (Rest,),
    "task.goals": (views.GoalTable,),
    "task.goals.camera_pose": (Pose.from_xyz_rpy,),
    "tolerances": (Tolerances,),
    "limits": (ActuatorLimits,),
    "disturbances": (Disturbances,),
    "arm": (ArmInput,),
    "plant": (ArmDynamics,),
    "sensor": (ImageSettings,),
    "plant.payload": (Payload,),
    "plant.friction": (Friction,),
    "plant.rods": (Rods,),
    "constraints.motion": (Motion,),
    "constraints.curve": (Curve,),
    "constraints.points": (RobotPoint,),
    "constraints.obstacle": (placed, *constraint_types.SOLIDS.values()),
    "constraints.bodies": (placed, *constraint_types.SOLIDS.values(), constraint_types.attached),
}
"""What is made of each table."""

GIVEN = {("task", "gains"), ("disturbances", "seed"), ("constraints.curve", "shape")}
"""Arguments that files do not give."""

Known = dict[tuple[str, str], inspect.Parameter]


def _known() -> Known:
    """Every key of every table, as the argument that it is."""
    found: Known = {}
    for table, makes in TABLES_OF.items():
        for make in makes:
            for key, parameter in parameters(make).items():
                if (table, key) not in GIVEN:
                    found.setdefault((table, key), parameter)
    for name, make in CONSTRAINTS.items():
        found |= {(name, key): parameter for key, parameter in constraint_types.keys(make).items()}
    return found


KNOWN = _known()
FURTHER = {
    **{("", key): "table" for key in ("extends",)},
    **{("target", key): "" for key in ("markers", "square", "motion")},
    ("task", "features"): "",
    ("plant", "type"): "",
    ("sensor", "type"): "",
    **{("constraints", key): "" for key in ("type", "motion", "K", "switching_gain")},
    **{(f"constraints.{table}", "shape"): "" for table in ("curve", "obstacle", "bodies")},
}
"""Keys that choose what is made of their table, or that all constraints have."""


def by_title() -> dict[str, dict[str, tuple[str, str]]]:
    """Type and default of each key below each heading of the page."""
    found = {}
    for text in re.split(r"^### ", PAGE.read_text(encoding="utf-8"), flags=re.M)[1:]:
        title, _, body = text.partition("\n")
        found[title] = {
            key: (kind, default or "–")
            for keys, kind, default in KEY.findall(body)
            for key in re.findall(r"\w+", keys)
        }
    return found


def documented() -> dict[str, dict[str, tuple[str, str]]]:
    """The same by the tables that the headings name."""
    titles = by_title()
    named = {
        name: keys for title, keys in titles.items() for name in re.findall(r"`([^`]+)`", title)
    }
    return {"": titles["Top level"], **named}


TABLES = documented()


def _keys_of(table: str) -> dict[str, tuple[str, str]]:
    common = TABLES["constraints"] if table in CONSTRAINTS else {}
    return {**common, **TABLES.get(table, {})}


def test_every_key_is_in_the_reference() -> None:
    missing = sorted(
        f"{table or 'the file'}: {key}"
        for table, key in (*KNOWN, *FURTHER)
        if key not in _keys_of(table)
    )
    assert not missing, f"docs/scenarios.md does not tell of {missing}"


def test_every_key_in_the_reference_is_known() -> None:
    read: dict[str, set[str]] = {}
    for table, key in (*KNOWN, *FURTHER):
        read.setdefault(table, set()).add(key)

    read["constraints.curve"].update(key for shape in SHAPES.values() for key in parameters(shape))
    unknown = []
    for title, keys in by_title().items():
        tables = re.findall(r"`([^`]+)`", title) or [""]  # one of them has it
        unknown += [
            f"{title}: {key}" for key in keys if not any(key in read[table] for table in tables)
        ]
    assert not unknown, f"docs/scenarios.md tells of {unknown}, which the loader does not know"


WORDS = {
    float: "number",
    int: "integer",
    str: "string",
    bool: "boolean",
    dict: "table",
    Mapping: "table",
}


def _word(kind: Any) -> str:
    """A word that the reference uses for an annotation."""
    inner = [one for one in get_args(kind) if not isinstance(one, msgspec.Meta)]
    if kind is constraint_types.Positive:
        return "number"
    if get_origin(kind) is types.UnionType or hasattr(kind, "__metadata__"):
        return _word(inner[0])
    if get_origin(kind) is Literal:
        return "string"
    if get_origin(kind) in (Sequence, tuple, list):
        return _word(inner[0]) if inner[0] in (*WORDS, constraint_types.Positive) else "list"
    return WORDS.get(get_origin(kind) or kind, "")


def test_types_and_defaults_are_those_of_the_arguments() -> None:
    for (table, key), parameter in KNOWN.items():
        kind, written = _keys_of(table)[key]
        where = f"{table or 'the file'}, {key}"
        default = parameter.default
        word = _word(parameter.annotation)
        assert word in kind.replace("pairs", "list"), f"{where} is a {word}, not {kind}"
        if default is parameter.empty:
            assert written == "required" or "required" in _meaning(key), where
        elif default is None:
            assert written == "–" or written.startswith("*") or "required" in written, where
        elif isinstance(default, int | float | str | tuple) and written != "required":
            value = tomllib.loads(f"value = {written.strip('`')}")["value"]
            same = np.array_equal(value, default) or default == (RobotPoint(),)
            assert same, f"{where} has the default {default}, not {value}"


def _meaning(key: str) -> str:
    """The lines of a key, in any table of the page."""
    text = PAGE.read_text(encoding="utf-8")
    return " ".join(re.findall(rf"^- .*`{key}`.*$", text, flags=re.M))


def test_shapes_and_their_defaults_are_in_the_reference() -> None:
    text = PAGE.read_text(encoding="utf-8")
    lines = [
        (name, key, default or "required")
        for name, options in re.findall(r"^- `(\w+)`: (.*)$", text, flags=re.M)
        for key, default in re.findall(r"`(\w+)`(?: = ([\d.]+))?", options)
    ]
    code = [
        (name, key, "required" if option.default is option.empty else str(option.default))
        for name, shape in SHAPES.items()
        for key, option in inspect.signature(shape).parameters.items()
    ]
    assert sorted(lines) == sorted(code)
    assert all(f'`"{name}"`' in text for name in constraint_types.SOLIDS)


def test_the_examples_use_every_key(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = reader_folder(tmp_path)
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {}
    used = "".join(path.read_text(encoding="utf-8") for path in SHIPPED.glob("*.toml"))
    for block in blocks(PAGE):
        if block.language != "sh":
            run(block, folder, names)
            used += block.code
    left = sorted(
        {key for _, key in (*KNOWN, *FURTHER) if not re.search(rf"\b{key}\b(\]| *=)", used)}
    )
    assert not left, f"no example on docs/scenarios.md uses {left}"


def test_what_a_run_is_told_has_the_same_words_in_files_and_in_python() -> None:
    """What is not made from the arm, the scene and the task is handed on as it is."""
    ours = parameters(build.File)
    theirs = parameters(Setup)
    made = {"robot", "camera", "target", "constraints"} | {
        "title",
        "description",
        "start_deviation",
    }
    # a setup's plant is the robot itself, and its sensor what it makes of the images
    in_python = {
        {"plant": "dynamics", "sensor": "images"}.get(key, key) for key in set(ours) - made
    }
    # how long a run may take beyond its duration, comparisons say
    assert in_python == set(theirs) - {"scene", "constraints", "time_limit"}
    for key in ("on_rank_loss", "on_hidden_markers", "actuation"):
        assert (ours[key].annotation, ours[key].default) == (
            theirs[key].annotation,
            theirs[key].default,
        )
