"""A single run of a campaign, made again from what its folder says."""

from __future__ import annotations

from pathlib import Path

from ...comparisons import RunRecord
from ...controllers import Controller, make_controller
from ...errors import unknown_name
from ...evidence import Evidence
from ...simulation import Setup, simulate, until_settled


def replay(folder: Path | str, family: str, scene: int, condition: str, controller: str) -> RunRecord:
    """Draw a scene of a campaign again and run a law on it: the same run, with its whole trajectory.

    Parameters
    ----------
    folder
        The campaign's.
    family, scene, condition, controller
        Which run, as tables of the campaign name it.

    Raises
    ------
    ConfigurationError
        if there is no evidence in the folder, or it holds no such family, scene, condition or law.
    """
    evidence = Evidence.load(Path(folder))
    setup = setup_of(evidence, family, scene, condition)
    return again(evidence, setup, controller)


def again(evidence: Evidence, setup: Setup, controller: str) -> RunRecord:
    """The run of a law on what has been set up."""
    return RunRecord.of(setup, simulate(setup, controller_of(evidence, controller)), "")


def setup_of(evidence: Evidence, family: str, scene: int, condition: str) -> Setup:
    """What is simulated in a scene, with its own noise."""
    if family not in evidence.families:
        raise unknown_name("family", family, evidence.families)
    return until_settled(evidence.drawn(family, scene).setup(condition))


def controller_of(evidence: Evidence, name: str) -> Controller:
    """A law with the options of the campaign."""
    entries = evidence.manifest["configuration"]["controllers"]
    if name not in entries:
        raise unknown_name("controller", name, entries)
    options = {key: value for key, value in entries[name].items() if key != "type"}
    return make_controller(str(entries[name].get("type", name)), options)
