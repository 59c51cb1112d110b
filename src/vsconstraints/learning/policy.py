"""A policy as a law: a small neural network gives q̈, which rows may filter."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from ..controllers import Controller, Pair, make_controller
from ..controllers.base import restart
from ..errors import ConfigurationError, InvalidInput, shown
from ..rows import Array, Command, Rows, Task
from .observation import ACCELERATION, Observer

PLANAR_ARM = Path(__file__).parent / "planar-arm.npz"  #: Weights for scenes of the family planar-arm.


class Policy(Controller):
    """A learned law: q̈ = a π(x), or q̈ = q̈_law + a π(x), of an observation x.

    π is a network of layers x ← W x + b with tanh between them; what the last one gives is cut to [-1, 1]. x and a are
    those of :class:`~vsconstraints.learning.observation.Observer`. It keeps no row by itself. A demand and a resolver
    filter it, of which q̈ is the task: with ``demand="barrier", resolver="filter"`` the command is the nearest to q̈
    that meets the barrier of every row.

    Parameters
    ----------
    weights
        A file of NumPy, .npz: ``W0`` (h, i), ``b0`` (h,), ``W1`` and so on, from the observation's size to n; and, if
        they are not the defaults, ``acceleration``, a where the scene states no limit [rad/s² or m/s²], and ``law``,
        the name of the law it adds to. Relative paths begin in the working directory.
    demand, resolver, options
        As of :class:`vsconstraints.controllers.laws.Pair`; no row is looked at if not given.

    Raises
    ------
    ConfigurationError
        if the file cannot be read, an array lacks, is no matrix or vector that fits the one before, or has a number
        that is not finite.
    """

    name = "policy"
    model: Any = None

    def __init__(
        self,
        *,
        weights: str | Path = PLANAR_ARM,
        demand: str = "nothing",
        resolver: str = "priority",
        **options: Any,
    ) -> None:
        self.weights, self.filter = str(weights), Pair(demand=demand, resolver=resolver, **options)
        self.layers, self.otherwise, law = read_weights(Path(weights))
        self.law = make_controller(law) if law else None
        self._observer: Observer | None = None

    @property
    def uses(self) -> tuple[str, ...]:
        """A model, of which q and q̇ are, L_fφ, and what filter and law use."""
        inner = (self.filter, *([self.law] if self.law else []))
        return tuple(dict.fromkeys(("L_fφ", *(known for law in inner for known in law.uses), "model")))

    def reset(self, period: float | None = None, model: Any = None) -> None:
        """Begin again; see :class:`.Controller`."""
        if model is not None:
            self.model, self._observer = model, None
        for law in filter(None, (self.filter, self.law)):
            if period is None:
                law.reset()
            else:
                restart(law, period, lambda: self.model)

    def action(self, x: Array) -> Array:
        """π(x) of an observation."""
        for W, b in self.layers[:-1]:
            x = np.tanh(W @ x + b)
        W, b = self.layers[-1]
        return np.minimum(np.maximum(W @ x + b, -1.0), 1.0)

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class; InvalidInput without a model, or if the network is of another size than this scene."""
        model = self.model
        if model is None:
            raise InvalidInput(
                f"{self.name} uses a model: tell it by reset(model=...) before the first command, or let a control "
                "step or a simulation do so"
            )
        if self._observer is None:
            self._observer = Observer(rows.scale, model.acceleration, model.ranges, self.otherwise)
        _, q, qd = model.present
        x, n = self._observer(rows, task, q, qd), task.J.shape[1]
        if (self.layers[0][0].shape[1], len(self.layers[-1][1])) != (len(x), n):
            raise InvalidInput(
                f"{self.weights}: the network takes {self.layers[0][0].shape[1]} numbers and gives "
                f"{len(self.layers[-1][1])}; this scene, of {len(rows.phi)} rows, {n} joints and {len(task.b)} "
                f"features, needs {len(x)} and {n}"
            )
        qdd = self._observer.action * self.action(x)
        if self.law is not None:
            qdd += self.law.command(rows, task).qdd
        return self.filter.command(rows, Task(np.eye(n), qdd))


def read_weights(path: Path) -> tuple[list[tuple[Array, Array]], float, str]:
    """Layers (W, b) of a network, its acceleration, and the name of the law it adds to; raises as :class:`Policy`."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
    except (OSError, ValueError, EOFError, BadZipFile, AttributeError, TypeError) as error:
        raise ConfigurationError(f"{path}: no weights can be read: {error}") from error
    law, acceleration = str(arrays.pop("law", "")), arrays.pop("acceleration", np.array(ACCELERATION))
    if acceleration.shape != () or acceleration.dtype.kind not in "fi" or not 0.0 < acceleration < np.inf:
        raise ConfigurationError(f"{path}: acceleration must be a positive number, not {shown(acceleration.tolist())}")
    layers: list[tuple[Array, Array]] = []
    for i in count():
        if i and not arrays:
            return layers, float(acceleration), law
        W, b = (_array(path, f"{name}{i}", arrays, dimensions) for name, dimensions in (("W", 2), ("b", 1)))
        size = len(layers[-1][1]) if layers else W.shape[1]
        if W.shape != (len(b), size):
            raise ConfigurationError(f"{path}: W{i} must be of the shape {(len(b), size)}, not {W.shape}")
        layers.append((W, b))
    raise AssertionError


def _array(path: Path, name: str, arrays: dict[str, Any], dimensions: int) -> Array:
    """An array of numbers that are finite, taken out of what a file holds."""
    if name not in arrays:
        others = ", ".join(arrays) or "nothing else"
        raise ConfigurationError(f"{path}: there is no {name}; a layer has W and b, counted from 0, not {others}")
    array = arrays.pop(name)
    if array.ndim != dimensions or array.dtype.kind not in "fi" or array.size == 0:
        raise ConfigurationError(
            f"{path}: {name} must have {dimensions} dimension(s) of numbers, not {array.shape} of {array.dtype}"
        )
    if not np.isfinite(array).all():
        raise ConfigurationError(f"{path}: {name} has numbers that are not finite")
    return array.astype(np.float64)
