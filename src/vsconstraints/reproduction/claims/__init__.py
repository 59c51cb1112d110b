"""The paper's claims, one function for each sentence: importing this package registers all of them."""

from . import (
    case_study,
    erroneous_gradients,
    every_scene,
    experiments,
    first_example,
    general,
    moving_and_time,
    studied,
    trap_and_corners,
)

__all__ = [
    "case_study",
    "erroneous_gradients",
    "every_scene",
    "experiments",
    "first_example",
    "general",
    "moving_and_time",
    "studied",
    "trap_and_corners",
]
