"""Optional packages, and the extra to install if one is missing."""

from __future__ import annotations

from importlib.util import find_spec
from typing import NamedTuple

from ..errors import ConfigurationError, unknown_name


class Extra(NamedTuple):
    """Purpose of ``pip install 'vsconstraints[NAME]'``, and the modules that it installs."""

    what: str
    modules: tuple[str, ...]


_TABLES = ("pandas", "pyarrow")

#: Extras by their names in pyproject.toml.
EXTRAS = {
    "evidence": Extra("evidence of drawn scenes", _TABLES),
    "tune": Extra("tuning of laws", (*_TABLES, "optuna")),
    "gym": Extra("an environment of Gymnasium", ("gymnasium",)),
    "images": Extra("control by images", ("cv2", "pupil_apriltags")),
    "pandas": Extra("tables as data frames", ("pandas",)),
    "notebooks": Extra(
        "tables, and laws of a session in other processes", ("pandas", "cloudpickle")
    ),
    "physics": Extra("the same arm in MuJoCo", ("mujoco",)),
    "ur-rtde": Extra(
        "an arm of Universal Robots", ("rtde_control", "rtde_receive", "dashboard_client")
    ),
    "bags": Extra("a recording of ROS", ("rosbags",)),
    "replay": Extra("a replay in a browser", ("viser", "imageio_ffmpeg")),
    "cluster": Extra("work on a cluster", (*_TABLES, "distributed")),
}


def demand(name: str, what: str = "") -> None:
    """Raise ConfigurationError unless all packages of an extra are installed.

    The message states what to install for ``what``.
    """
    if name not in EXTRAS:
        raise unknown_name("extra", name, EXTRAS)
    missing = [module for module in EXTRAS[name].modules if find_spec(module) is None]
    if missing:
        needs = f"{what or EXTRAS[name].what} needs {', '.join(missing)}"
        raise ConfigurationError(f"{needs}: pip install 'vsconstraints[{name}]'")
