"""The search of one law's options: the same tuner for every law."""

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
    """A law as the campaign defines it; the options that it sets are not searched."""

    law: ControllerSpec

    @cached_property
    def ranges(self) -> dict[str, Range | Choices]:
        """Of its options, but for those that the campaign sets."""
        return law_ranges(self.law.law, self.law.options, self.law.folder)

    @cached_property
    def default(self) -> Options:
        """The default values of these options."""
        law = self.law.make()
        return {option: default_of(law, option) for option in self.ranges}

    def setting(self, options: Mapping[str, Any]) -> ControllerSpec:
        """The law with these options; None leaves one to the law."""
        given = {option: value for option, value in options.items() if value is not None}
        return ControllerSpec(self.law.name, self.law.law, {**self.law.options, **given}, self.law.folder)


class Search:
    """Suggests settings of a law, one after the other, the default first.

    The others are drawn by the tree-structured Parzen estimator for several objectives (Ozaki et al. 2022), with the
    constraint (Watanabe and Hutter 2023), for all options together. They depend only on the seed and on what was told.
    """

    def __init__(self, searched: Searched, seed: int) -> None:
        import optuna

        self.searched, self.seed = searched, seed
        default = {
            option: ranged.values.index(searched.default[option])
            if isinstance(ranged, Choices)
            else searched.default[option]
            for option, ranged in searched.ranges.items()
        }
        with _quiet():
            sampler = optuna.samplers.TPESampler(
                seed=seed, multivariate=True, constraints_func=lambda trial: (trial.user_attrs[EXCESS],)
            )
            self._study = optuna.create_study(directions=["minimize"] * len(OBJECTIVES), sampler=sampler)
            self._study.enqueue_trial(default)

    def ask(self) -> Options:
        """The next setting's options."""
        with _quiet():
            self._trial = self._study.ask()
            return {option: self._suggested(option, ranged) for option, ranged in self.searched.ranges.items()}

    def tell(self, point: Point, excess: float) -> None:
        """Tell the objectives of the last setting, and by how much it exceeds what the constraint allows."""
        with _quiet():
            self._trial.set_user_attr(EXCESS, excess)
            self._study.tell(self._trial, list(point))

    def _suggested(self, option: str, ranged: Range | Choices) -> Any:
        if isinstance(ranged, Choices):
            return ranged.values[self._trial.suggest_categorical(option, tuple(range(len(ranged.values))))]
        if ranged.integer:
            return self._trial.suggest_int(option, int(ranged.least), int(ranged.greatest), log=ranged.logarithmic)
        return self._trial.suggest_float(option, ranged.least, ranged.greatest, log=ranged.logarithmic)


@contextmanager
def _quiet() -> Iterator[None]:
    """Without Optuna's messages on every trial, and on what it calls experimental."""
    import optuna

    level = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    finally:
        optuna.logging.set_verbosity(level)
