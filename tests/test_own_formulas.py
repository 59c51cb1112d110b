"""Own formulas that do not fit together are refused, not silently given another one's rows."""

import pickle
import sys

import numpy as np
import pytest

from vsconstraints.constraints import Circle, Curve, ImageConstraint
from vsconstraints.controllers import Controller
from vsconstraints.errors import ConfigurationError
from vsconstraints.plugins.classes import beside, imported_class


def half(u, v, r):
    return 1.0 - u / r, -1.0 / r + 0.0 * u, 0.0 * v


class Line(Circle):
    name = "line"
    formula = staticmethod(half)


class FlatLine(Line):
    curvature_formula = None


class Everything(ImageConstraint):
    kind = "everything"


def test_a_formula_with_the_curvature_of_another_is_refused():
    with pytest.raises(
        ConfigurationError,
        match="Line defines formula, but inherits curvature_formula from Circle",
    ):
        Curve(Line(10.0))
    np.testing.assert_allclose(
        Curve(FlatLine(10.0)).curvature(np.ones((2, 2)), np.ones((2, 2))), 0.0, atol=1e-9
    )


def test_a_class_that_says_nothing_is_refused():
    with pytest.raises(ConfigurationError, match="needs a formula, or sigma and gradient"):
        Everything(K=0.1, switching_gain=1.0, length=1.0)


def test_folders_of_own_modules_are_searched_in_their_order(tmp_path):
    folders = [tmp_path / str(number) for number in range(10)]
    before = list(sys.path)
    with beside(*folders, None, folders[0]):
        assert sys.path == [*before, *map(str, folders)]
    assert sys.path == before


OWN_LAW = """
from dataclasses import dataclass

from vsconstraints.controllers import Demand, Filter, Law


@dataclass(frozen=True)
class Half(Demand):
    share: float = 0.5
    name, uses = "half", ()

    def formula(row, share):
        return -share * row.switching_gain


class HalfFilter(Law):
    name = "half-filter"

    def __init__(self):
        super().__init__(Half(), Filter())
"""


def test_formulas_of_a_file_that_a_suite_names_can_be_kept_by_the_compiler(tmp_path):
    """It pickles them: what cannot be pickled would run in NumPy, with a warning."""
    (tmp_path / "version 1.2").mkdir()
    (tmp_path / "version 1.2" / "mine.py").write_text(OWN_LAW)
    law = imported_class("mine:HalfFilter", Controller, tmp_path / "version 1.2")()
    formula = type(law.demand).formula
    assert pickle.loads(pickle.dumps(formula)) is formula
