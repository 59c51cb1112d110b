"""A single run of a campaign, made again from what its folder says."""

from __future__ import annotations

from pathlib import Path

from ...comparisons import RunRecord
from ...comparisons.evidence import Evidence
from ...controllers import Controller, make_controller
from ...errors import unknown_name
from ...plugins.classes import untrusted
from ...simulation import Setup, simulate, until_settled


def replay(
    folder: Path | str, family: str, scene: int, condition: str, controller: str, *, trust: bool = False
) -> RunRecord:
    """Draw a scene of a campaign again and run a law on it: the same run, with its whole trajectory.

    Parameters
    ----------
    folder
        The campaign's.
    family, scene, condition, controller
        Which run, as tables of the campaign name it.
    trust
        Whether code that the campaign names as ``module:Class`` may run.

    Raises
    ------
    ConfigurationError
        if there is no evidence in the folder, it holds no such family, scene, condition or law, or the run needs code
        that is not trusted.
    """
    evidence = Evidence.load(Path(folder), trust)
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
    law, options = str(entries[name].get("type", name)), {k: v for k, v in entries[name].items() if k != "type"}
    if ":" in law and not evidence.trusted:
        raise untrusted(f"controller {name}", [law])
    return make_controller(law, options)
