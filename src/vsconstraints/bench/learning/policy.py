"""Policy as a law: a small neural network computes q̈, which rows may filter."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO
from zipfile import ZipFile

import numpy as np

from ...controllers import Controller, Pair, make_controller
from ...controllers.base import require_model, restart
from ...controllers.ranges import positive_number
from ...errors import ConfigurationError, InvalidInput, one_line
from ...plugins.regular_files import require_regular
from ...rows import Array, Command, Rows, Task

#: Acceleration of an action of 1 if the scene states no limit [rad/s² or m/s²].
ACCELERATION = 10.0
LARGE = 1e30  #: Weights below cannot overflow.
MAX_BYTES = 1_000_000_000  #: Maximum size of the arrays of a weights file.

_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


class Observer:
    """Observation of a policy: 2 m + m n + k n + k + 2 n numbers for m rows, n joints, k features.

    It consists of φ/s, L_fφ/s and L_gφ a/s, where s (m,) is the ``scale`` of the rows; of J a/‖J a‖
    and b/‖J a‖; of q, relative to the middle of its range and divided by half of the range; and of
    q̇, divided by the greatest speed. Joints without a limit are not scaled. Matrices are flattened
    row by row. Each number x is mapped to x/(1 + |x|). ``action`` is a (n,): the limit of
    ``acceleration`` (n,), or ``otherwise`` if that is infinite. For ``ranges`` see
    :attr:`vsconstraints.robots.Robot.ranges`.
    """

    def __init__(
        self,
        scale: Array,
        acceleration: Array,
        ranges: tuple[Array, Array, Array],
        otherwise: float,
    ) -> None:
        known = [np.where(np.isfinite(each), each, np.nan) for each in ranges]
        low, high, speed = known
        self.action = np.where(np.isfinite(acceleration), acceleration, otherwise)
        self._middle = np.nan_to_num(0.5 * (low + high))
        half_range = np.where(high > low, 0.5 * (high - low), 1.0)
        greatest_speed = np.nan_to_num(speed, nan=1.0)
        gradient_factor = self.action / scale[:, None]
        # factors of φ, L_fφ and L_gφ, and of q and q̇
        self._row_factor = np.concatenate((1.0 / scale, 1.0 / scale, gradient_factor.ravel()))
        self._joint_factor = 1.0 / np.concatenate((half_range, greatest_speed))

    def __call__(self, rows: Rows, task: Task, q: Array, qd: Array) -> Array:
        """Return the observation of rows and task at q and q̇ (n,)."""
        row_values = np.concatenate((rows.phi, rows.Lf, rows.Lg.ravel()))
        of_rows = row_values * self._row_factor
        Ja = (task.J * self.action).ravel()
        norm = float(Ja @ Ja) ** 0.5
        task_values = np.concatenate((Ja, task.b))
        of_task = task_values / (norm or 1.0)
        joint_values = np.concatenate((q - self._middle, qd))
        of_joints = joint_values * self._joint_factor
        x = np.concatenate((of_rows, of_task, of_joints))
        observation: Array = x / (1.0 + np.abs(x))
        return observation


class Policy(Controller):
    """A learned law: q̈ = a π(x), or q̈ = q̈_law + a π(x), with x and a of :class:`Observer`.

    π is a network of layers W x + b with tanh between them, whose output is clipped to [-1, 1]. The
    network does not enforce any row: q̈ is the task of a demand and a resolver. With
    ``demand="barrier", resolver="filter"`` the command is the closest to q̈ that satisfies the
    barriers of all rows. Raises ConfigurationError if the file cannot be read, or an array is
    missing, has the wrong shape, or contains a number that is not finite.

    Parameters
    ----------
    weights
        A NumPy file, .npz: ``W0`` (h, i), ``b0`` (h,), ``W1`` and so on. If they differ from the
        default, also ``acceleration``, a where the scene states no limit [rad/s² or m/s²], and
        ``law``, the name of that law.
    demand, resolver, options
        As in :class:`vsconstraints.controllers.laws.Pair`; no row is enforced by default.
    """

    name = "policy"
    model: Any = None

    def __init__(
        self, *, weights: str, demand: str = "nothing", resolver: str = "priority", **options: Any
    ) -> None:
        self.weights = weights
        self.filter = Pair(demand=demand, resolver=resolver, **options)
        self.layers, self.otherwise, law = read_weights(Path(weights))
        self.law = make_controller(law) if law else None
        self._observer: Observer | None = None

    @property
    def uses(self) -> tuple[str, ...]:
        """Required information: L_fφ, a model (for q and q̇), and that of filter and law."""
        information = ["L_fφ", "model", *self.filter.uses]
        if self.law is not None:
            information += self.law.uses
        return tuple(dict.fromkeys(information))

    def reset(self, period: float | None = None, model: Any = None) -> None:
        """Reset filter and law; see :class:`.Controller`."""
        self.model = model or self.model
        self._observer = None
        for law in (self.filter, self.law):
            if law is None:
                continue
            if period is None:
                law.reset()
            else:
                restart(law, period, lambda: self.model)

    def action(self, x: Array) -> Array:
        """Return π(x) of an observation."""
        *hidden, (last_W, last_b) = self.layers
        for W, b in hidden:
            x = np.tanh(W @ x + b)
        return np.minimum(np.maximum(last_W @ x + last_b, -1.0), 1.0)

    def solve(self, rows: Rows, task: Task) -> Command:
        """Return the filtered command; see the class.

        Raises InvalidInput without a model, and if the network does not fit the size of the scene.
        """
        model = self.model
        n = task.J.shape[1]
        require_model(self.name, rows, task, model)
        if self._observer is None:
            self._observer = Observer(rows.scale, model.acceleration, model.ranges, self.otherwise)
        _, q, qd = model.present
        x = self._observer(rows, task, q, qd)
        first_W, _ = self.layers[0]
        _, last_b = self.layers[-1]
        sizes = (first_W.shape[1], len(last_b))
        if sizes != (len(x), n):
            scene = f"{len(rows.phi)} rows, {n} joints and {len(task.b)} features"
            raise InvalidInput(
                f"{self.weights}: a network of {sizes}, not {(len(x), n)} numbers as for {scene}"
            )
        qdd = self._observer.action * self.action(x)
        if self.law is not None:
            qdd += self.law.command(rows, task).qdd
        return self.filter.command(rows, Task(np.eye(n), qdd))


def _require_small(opened: BinaryIO) -> None:
    """Raise ValueError if the arrays of an archive declare more than :data:`MAX_BYTES`.

    No array is expanded for the check.
    """
    with ZipFile(opened) as archive:
        size = sum(member.file_size for member in archive.infolist())
        if size > MAX_BYTES:
            raise ValueError(
                f"its arrays have {size / 1e6:.0f} MB, and may have {MAX_BYTES / 1e6:g}"
            )
        for member in archive.infolist():
            with archive.open(member) as array:
                read = _HEADERS.get(np.lib.format.read_magic(array))
                if read is None:
                    raise ValueError(f"{member.filename} is in an unknown format")
                shape, _, kind = read(array)
                stated_size = array.tell() + math.prod(shape) * kind.itemsize
                if not kind.hasobject and stated_size != member.file_size:
                    raise ValueError(f"{member.filename} is not as large as it says")
    opened.seek(0)


def read_weights(path: Path) -> tuple[list[tuple[Array, Array]], float, str]:
    """Return the layers (W, b), the acceleration and the name of a law, empty for none.

    Raises the errors of :class:`Policy`.
    """
    try:
        require_regular(path)
        with path.open("rb") as opened:
            _require_small(opened)
            with np.load(opened, allow_pickle=False) as file:
                arrays = dict(file)
    except Exception as error:  # NumPy raises any error for invalid headers and archives
        what = one_line(str(error)) or type(error).__name__
        raise ConfigurationError(
            f"{path}: weights cannot be read: {what}; write them with numpy.savez"
        ) from error
    law = str(arrays.pop("law", ""))
    acceleration = arrays.pop("acceleration", np.array(ACCELERATION)).tolist()
    layers = _layers(path, arrays)
    return layers, positive_number(f"acceleration in {path}", acceleration), law


def _layers(path: Path, arrays: Mapping[str, Array]) -> list[tuple[Array, Array]]:
    """Return the layers (W, b) of a file. Raises ConfigurationError if they do not fit together."""
    count = max(1, (len(arrays) + 1) // 2)
    names = [(f"W{i}", f"b{i}") for i in range(count)]
    if set(arrays) != set(chain.from_iterable(names)):
        raise ConfigurationError(
            f"{path}: layers are W0, b0, W1, b1 and so on, not {', '.join(arrays) or 'none'}"
        )
    for name, array in arrays.items():
        are_numbers = array.dtype.kind in "fi"
        if not are_numbers or not (np.abs(array) < LARGE).all():
            raise ConfigurationError(
                f"{path}: {name} must have only finite numbers less than {LARGE:g}"
            )
    layers = []
    inputs = arrays["W0"].shape[-1:]
    for W_name, b_name in names:
        W = arrays[W_name]
        b = arrays[b_name]
        if W.ndim != 2 or W.shape != (*b.shape, *inputs):
            shapes = f"{W_name} and {b_name} have the shapes {W.shape} and {b.shape}"
            columns = inputs[0] if inputs else "i"
            raise ConfigurationError(f"{path}: {shapes}, not (h, {columns}) and (h,)")
        layers.append((W, b))
        inputs = b.shape
    return layers
