"""Distributions that stand in a family's file where a number, or a list of numbers, stands in a scenario's."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from ...errors import ConfigurationError, shown
from ...rows import Array

LARGEST = 1e300
"""Numbers beyond cannot be drawn with."""


class Distribution(ABC):
    """What a value is drawn from; numbers in it are single ones or arrays of one shape, drawn number by number."""

    name: ClassVar[str]
    """The one key of its table: ``{ name = [...] }``."""

    @abstractmethod
    def __init__(self, value: object, where: str) -> None:
        """From what its table says; raises ConfigurationError that names ``where`` if nothing can be drawn from it."""

    @abstractmethod
    def draw(self, random: np.random.Generator) -> Any:
        """A value of Python's own, as files hold it."""


class TwoNumbers(Distribution):
    """Two numbers, or two arrays, of one shape after broadcasting."""

    words: ClassVar[str]
    """What the two are, for messages."""

    def __init__(self, value: object, where: str) -> None:
        self.where = f"{where}: {self.name}"
        try:
            if not isinstance(value, list) or len(value) != 2:
                raise ValueError
            first, second = np.broadcast_arrays(*(np.asarray(part, dtype=np.float64) for part in value))
        except (TypeError, ValueError) as error:
            raise ConfigurationError(f"{self.where} must be [{self.words}], not {shown(value)}") from error
        if not (np.abs([first, second]) <= LARGEST).all():
            raise ConfigurationError(f"{self.where} must be finite, and less than 1e300, not {shown(value)}")
        if first.size == 0:
            raise ConfigurationError(f"{self.where} is of no number at all: {shown(value)}")
        self.first, self.second = first, second

    def demand(self, fine: Any, rule: str) -> None:
        """Raise ConfigurationError that states the rule unless all numbers are fine."""
        if not np.all(fine):
            raise ConfigurationError(f"{self.where} = [{self.words}] needs {rule}, not {shown(self.numbers)}")

    @property
    def numbers(self) -> list[Any]:
        """Both, as files hold them."""
        return [self.first.tolist(), self.second.tolist()]


class Uniform(TwoNumbers):
    """Every number between two is as likely."""

    name, words = "uniform", "least, greatest"

    def __init__(self, value: object, where: str) -> None:
        super().__init__(value, where)
        self.demand(self.first <= self.second, "least ≤ greatest")

    def draw(self, random: np.random.Generator) -> Any:
        """From [least, greatest)."""
        return np.asarray(random.uniform(self.first, self.second)).tolist()


class LogUniform(TwoNumbers):
    """Every order of magnitude between two is as likely."""

    name, words = "log-uniform", "least, greatest"

    def __init__(self, value: object, where: str) -> None:
        super().__init__(value, where)
        self.demand((self.first > 0.0) & (self.first <= self.second), "0 < least ≤ greatest")

    def draw(self, random: np.random.Generator) -> Any:
        """Exp of a uniform draw between the logarithms."""
        drawn: Array = np.exp(random.uniform(np.log(self.first), np.log(self.second)))
        # rounding of exp and log must not lead out
        return np.clip(drawn, self.first, self.second).tolist()


class Gaussian(TwoNumbers):
    """The normal distribution; called by its other name since half-spaces have normals."""

    name, words = "gaussian", "mean, standard deviation"

    def __init__(self, value: object, where: str) -> None:
        super().__init__(value, where)
        self.demand(self.second >= 0.0, "a standard deviation ≥ 0")

    def draw(self, random: np.random.Generator) -> Any:
        """A draw around each mean."""
        return np.asarray(random.normal(self.first, self.second)).tolist()


class Integer(TwoNumbers):
    """Every integer between two, both included, is as likely."""

    name, words = "integer", "least, greatest"

    def __init__(self, value: object, where: str) -> None:
        super().__init__(value, where)
        whole = (self.first == np.round(self.first)) & (self.second == np.round(self.second))
        self.demand(whole & (np.abs(self.numbers) < 2**53).all(axis=0), "integers")
        self.demand(self.first <= self.second, "least ≤ greatest")

    def draw(self, random: np.random.Generator) -> Any:
        """From {least, …, greatest}."""
        least, greatest = self.first.astype(np.int64), self.second.astype(np.int64)
        return np.asarray(random.integers(least, greatest, endpoint=True)).tolist()


class Choice(Distribution):
    """One of several values, of any kind, each as likely."""

    name = "choice"

    def __init__(self, value: object, where: str) -> None:
        if not isinstance(value, list) or not value:
            raise ConfigurationError(f"{where}: choice must be a list of one or more values, not {shown(value)}")
        self.values = value

    def draw(self, random: np.random.Generator) -> Any:
        """One of them."""
        return self.values[int(random.integers(len(self.values)))]


DISTRIBUTIONS: Mapping[str, type[Distribution]] = {
    kind.name: kind for kind in (Uniform, LogUniform, Gaussian, Integer, Choice)
}
"""All of them, by the key of their tables."""
