"""Messages between a comparison and a stack in another process: one JSON object per line.

docs/stacks.md describes the protocol. The stack writes a declaration, reads the setup, and then
answers one line per period with one line.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import msgspec
import numpy as np

from ..errors import ConfigurationError, format_value, one_line, unknown_name
from ..simulation.programs import OUTPUTS, Answer, Output

VERSION = 1  #: Version of the protocol.
MAX_TEXT = 200  #: Characters of a stack's text that results and messages show.
#: Units of all numbers in messages.
UNITS = {"length": "m", "angle": "rad", "time": "s", "image": "px"}

#: Data that a stack may use before a run, and what they are.
BEFORE_A_RUN = {
    "urdf": "the robot as URDF text without meshes, and the name of its tip",
    "limits": "ranges, speeds, accelerations and jerks of the joints",
    "camera": "intrinsics, distortion and mount",
    "target": "markers, and the frame that they are fixed to",
    "goals": "pixels and pose of the camera at each goal, and in each period the goal's index",
    "constraints": "the constraints with their parameters",
}
#: Data that a stack may use in each period.
IN_EACH_PERIOD = {
    "q": "joint coordinates",
    "qd": "joint speeds",
    "pixels": "sensor pixels of the markers, and the time of the image",
    "pose": "pose of the camera in the target's frame, estimated from the image",
    "jacobian": "Jacobian of the camera's twist relative to the target, in the camera's frame",
}
#: All data that a stack may declare as used.
USES: dict[str, str] = BEFORE_A_RUN | IN_EACH_PERIOD

#: Names in ``uses`` of the keys of messages that have another name.
USES_OF_KEYS = {
    "tip": "urdf",
    "feature": "goals",
    "goal": "goals",
    "taken": "pixels",
    "camera_in_target": "pose",
}


def undeclared(key: str, uses: Collection[str] = ()) -> str:
    """Return the end of a sentence on a stack that reads a key of a message without declaring it.

    It is empty if no message has this key, or if ``uses`` has what gives it.
    """
    name = USES_OF_KEYS.get(key, key)
    if name not in USES or name in uses:
        return ""
    return f"uses {key!r} without declaring it: add {name!r} to uses"


#: What decoding a line raises: texts that are not UTF-8 have an error of their own.
UNREADABLE = (msgspec.MsgspecError, UnicodeDecodeError)


class StackFailedError(Exception):
    """A stack cannot go on; the message is the reason, with its last messages if it has any."""


class Declaration(msgspec.Struct, forbid_unknown_fields=True):
    """First line of a stack: version of its protocol, data that it uses, kind of its commands."""

    protocol: int
    uses: list[str]
    output: str
    name: str = ""  #: Name and version of the stack, for the results.


class _Version(msgspec.Struct):
    """Version of a declaration, whatever else that version has."""

    protocol: int


class _Reply(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Line of a stack in each period."""

    velocity: list[float] | None = None
    position: list[float] | None = None
    acceleration: list[float] | None = None
    no_answer: str | None = None
    t: float | None = None  #: Time of the period that it answers, if the stack repeats it.
    compute_s: float | None = None


def _listed(value: object) -> object:
    """Return an array as a list; raises TypeError for any other object that JSON does not have."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(
        f"messages to a stack hold numbers, texts, arrays, lists and tables, and nothing of type "
        f"{type(value).__name__}"
    )


#: Encode data as JSON, with arrays as lists, and null for numbers that are not finite. Raises
#: TypeError for an object that JSON does not have.
encode = msgspec.json.Encoder(enc_hook=_listed).encode
decode = msgspec.json.decode
_decode_reply = msgspec.json.Decoder(_Reply).decode
_decode_declaration = msgspec.json.Decoder(Declaration).decode
_decode_version = msgspec.json.Decoder(_Version).decode


def checked_declaration(uses: object, output: object) -> tuple[tuple[str, ...], Output]:
    """Return the data that a stack declares as used, each once, and its output.

    Raises StackFailedError, with the candidates, if a name is unknown.
    """
    if not isinstance(uses, list | tuple):
        raise StackFailedError(f"uses must be a list of names, not {format_value(uses)}")
    for name in uses:
        if name not in USES:
            raise StackFailedError(str(unknown_name("data in uses", name, USES)))
    for known in OUTPUTS:
        if output == known:
            return tuple(dict.fromkeys(map(str, uses))), known
    raise StackFailedError(str(unknown_name("output of a stack", output, OUTPUTS)))


def read_declaration(line: bytes) -> Declaration:
    """Return the declaration in a line; raises StackFailedError if it is not one.

    Its names are those that the stack gave: :func:`checked_declaration` checks them.
    """
    try:
        version = _decode_version(line).protocol
        # another version may have other fields
        if version != VERSION:
            raise StackFailedError(
                f"it speaks version {version} of the protocol, and this package version {VERSION}"
            )
        return _decode_declaration(line)
    except UNREADABLE as error:
        example = '{"protocol": 1, "uses": ["q"], "output": "velocity"}'
        raise StackFailedError(
            f"its first line on standard output must be its declaration, such as {example}, "
            f"not {_shown(line)} ({error})"
        ) from error


def read_reply(line: bytes, output: Output, n: int, t: float) -> Answer:
    """Return the answer in a line for n joints to the period at time t [s].

    Raises StackFailedError if it is not one.
    """
    try:
        reply = _decode_reply(line)
    except UNREADABLE as error:
        if b"NaN" in line or b"Infinity" in line:
            raise StackFailedError(
                f"it answered numbers that are not finite: {_shown(line)}"
            ) from error
        raise StackFailedError(
            "a line on standard output must be an answer, and everything else belongs on standard "
            f"error: it wrote {_shown(line)} ({error})"
        ) from error
    time = math.nan if reply.compute_s is None else reply.compute_s
    if time < 0.0:
        raise StackFailedError(f"its compute_s must be a time in seconds, not {time}")
    if reply.t is not None and not abs(reply.t - t) <= rounding_of_time(t):
        raise StackFailedError(
            f"it answered the period at t = {reply.t:.9g} s when it was asked at {t:.9g} s: one "
            "line answers one period"
        )
    if reply.no_answer is not None:
        return Answer(None, time, one_line(reply.no_answer, MAX_TEXT) or "it gave no reason")
    return checked_answer(getattr(reply, output), output, n, time)


#: Rounding of a repeated time [s], if it is not that of single precision, which grows with time.
SAME_TIME = 1e-6
SINGLE_PRECISION = float(np.finfo(np.float32).eps)  #: Relative resolution of single precision.
#: Largest number in an answer; the differences of larger ones may be infinite.
LARGEST = 1e12


def rounding_of_time(t: float) -> float:
    """Return the largest error [s] of a time that a stack repeats in single precision or better."""
    return max(SAME_TIME, SINGLE_PRECISION * t)


def checked_answer(command: Any, output: Output, n: int, compute_time: float) -> Answer:
    """Return an answer for n joints; raises StackFailedError if it is not n finite numbers."""
    if command is None:
        raise StackFailedError(f"it declared the output {output!r} and answered none")
    try:
        numbers = np.array(command, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise StackFailedError(
            f"its {output} must be {n} numbers, not {format_value(command)}"
        ) from error
    if numbers.shape != (n,):
        raise StackFailedError(
            f"its {output} must be {n} numbers, one per joint; it has the shape {numbers.shape}"
        )
    greatest = np.abs(numbers).max(initial=0.0)  # NaN if an entry is
    if not math.isfinite(greatest):
        raise StackFailedError(f"its {output} is not finite: {numbers}")
    if greatest > LARGEST:
        raise StackFailedError(
            f"its {output} is beyond {LARGEST:g}, which no arm reaches: {numbers}"
        )
    return Answer(numbers, compute_time)


def require_settings_of_json(value: object, name: str = "settings") -> None:
    """Raise ConfigurationError, with its name, if JSON does not have a setting, as inf and NaN.

    Settings may be tables, lists and arrays.
    """
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, Mapping):
        for key, each in value.items():
            require_settings_of_json(each, f"{name}.{key}")
    elif isinstance(value, list | tuple):
        for i, each in enumerate(value):
            require_settings_of_json(each, f"{name}[{i}]")
    elif isinstance(value, float) and not math.isfinite(value):
        raise ConfigurationError(
            f"{name} of a stack must be finite, not {value}: leave it out, or give a large number"
        )
    try:
        encode(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ConfigurationError(f"{name} of a stack cannot be sent: {error}") from error


def setup_message(data: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the message that a stack gets before a run."""
    return {"protocol": VERSION, "units": UNITS, "settings": dict(settings), **data}


def _shown(line: bytes) -> str:
    text = line.decode("utf-8", "replace").strip()
    return repr(text if len(text) <= MAX_TEXT else f"{text[:MAX_TEXT]}…")
