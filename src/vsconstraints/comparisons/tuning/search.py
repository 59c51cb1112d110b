"""One law's search: the same tuner for every law, told of one setting after the other."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ...controllers import Choices, Range, law_ranges
from ...controllers.ranges import default_of
from ..runs.spec import ControllerSpec
from .objectives import OBJECTIVES, Point

Options = dict[str, Any]

EXCESS = "excess"
"""Attribute of a trial: by how much its constraint is exceeded; not at all if it is not positive."""


@dataclass(frozen=True)
class Searched:
    """A law and what of it is searched.

    Attributes
    ----------
    law
        As the campaign gives it; what it sets stays.
    """

    law: ControllerSpec

    @cached_property
    def ranges(self) -> dict[str, Range | Choices]:
        """Of its options, but for those that the campaign sets."""
        return law_ranges(self.law.law, self.law.options, self.law.folder)

    @cached_property
    def default(self) -> Options:
        """The values that these options have otherwise."""
        made = self.law.make()
        return {option: default_of(made, option) for option in self.ranges}

    def setting(self, options: Mapping[str, Any]) -> ControllerSpec:
        """The law with these options; None leaves one to the law."""
        given = {option: value for option, value in options.items() if value is not None}
        return ControllerSpec(self.law.name, self.law.law, {**self.law.options, **given}, self.law.folder)


class Search:
    """Asks for settings of a law and is told what they are worth.

    The default is asked for first. The next ones are drawn by the tree-structured Parzen estimator for several
    objectives (Ozaki et al. 2022), which is told of the constraint (Watanabe and Hutter 2023), for all options
    together, from a seed. What is asked for depends on nothing but that and what was told, one after the other.

    Parameters
    ----------
    searched
        The law.
    seed
        Of the tuner.
    """

    def __init__(self, searched: Searched, seed: int) -> None:
        import optuna

        self.searched, self.seed = searched, seed
        with _quiet():
            sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, constraints_func=_excess)
            self._study = optuna.create_study(directions=["minimize"] * len(OBJECTIVES), sampler=sampler)
            self._study.enqueue_trial({key: self._code(key, value) for key, value in searched.default.items()})

    def ask(self) -> Options:
        """The next setting's options."""
        with _quiet():
            self._trial = self._study.ask()
            return {option: self._suggested(option, one) for option, one in self.searched.ranges.items()}

    def tell(self, point: Point, excess: float) -> None:
        """What the setting that was asked for is worth, and by how much it exceeds what the constraint allows."""
        with _quiet():
            self._trial.set_user_attr(EXCESS, excess)
            self._study.tell(self._trial, list(point))

    def _code(self, option: str, value: Any) -> Any:
        one = self.searched.ranges[option]
        return one.values.index(value) if isinstance(one, Choices) else value

    def _suggested(self, option: str, one: Range | Choices) -> Any:
        if isinstance(one, Choices):
            return one.values[self._trial.suggest_categorical(option, tuple(range(len(one.values))))]
        if one.integer:
            return self._trial.suggest_int(option, int(one.least), int(one.greatest), log=one.logarithmic)
        return self._trial.suggest_float(option, one.least, one.greatest, log=one.logarithmic)


def _excess(trial: Any) -> tuple[float]:
    return (trial.user_attrs[EXCESS],)


@contextmanager
def _quiet() -> Iterator[None]:
    """Without Optuna's word on every trial, and on what it calls experimental."""
    import optuna

    level = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    finally:
        optuna.logging.set_verbosity(level)
