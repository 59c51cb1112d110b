"""What ``checks.known`` takes out of disturbed scenes, and what it makes late."""

from __future__ import annotations

from math import ceil
from typing import Any

import pytest
from checks.known import DEAD_TIME, DISTURBANCES, KNOWN, LAWS, STUDIES, Changed

from vsconstraints.bench.families.frozen import TestSet

FAMILIES = {family.name: family for family in TestSet.load().families}


def tables_of(family: str, study: str) -> dict[str, Any]:
    scene, _ = Changed(FAMILIES[family], study).set_up(0, "held-out", TestSet.load().seed)
    return dict(scene.tables)


@pytest.mark.parametrize("family", FAMILIES)
def test_nothing_is_unknown_once_everything_is_known(family: str) -> None:
    """What is left is the nominal scene with the tolerances of the disturbed one; one by one all of
    it is taken out.
    """
    scene = FAMILIES[family].scene(0, "held-out", TestSet.load().seed)
    told = tables_of(family, "known")
    nominal = scene.tables["nominal"]
    left = {**told["all known"], "tolerances": nominal.get("tolerances"), "disturbances": {}}
    assert told["all known"]["disturbances"] == {}
    assert told["disturbed"] == scene.tables["disturbed"]
    assert {key: value for key, value in left.items() if value != nominal.get(key)} == {
        "disturbances": {}
    }
    gone = {
        name: told["disturbed"]["disturbances"].keys() - told[f"{name} known"]["disturbances"]
        for name in DISTURBANCES
    }
    assert set().union(*gone.values()) == told["disturbed"]["disturbances"].keys()
    assert {*told} == {*KNOWN} == {*STUDIES["known"][0]}


@pytest.mark.parametrize("family", ["moving", "six-axis"])
@pytest.mark.parametrize("study", ["images", "commands"])
def test_what_is_late_is_late_by_the_dead_time_and_nothing_else_changes(
    study: str, family: str
) -> None:
    changed = tables_of(family, study)
    names = ["nominal", "late", *(["late, dated"] if study == "images" else [])]
    assert [*changed] == [*STUDIES[study][0]] == names
    late: dict[str, float] = {"command_delay": DEAD_TIME}
    if study == "images":
        late = {"delay": ceil(DEAD_TIME / changed["nominal"]["sampling_time"])}
    assert {**changed["late"], "disturbances": {}} == {**changed["nominal"], "disturbances": {}}
    assert changed["late"]["disturbances"] == {**changed["nominal"].get("disturbances", {}), **late}
    if study == "images":
        dated = {**changed["late"]["disturbances"], "delay_known": True}
        assert changed["late, dated"] == {**changed["late"], "disturbances": dated}
    told = {key: options for key, options in STUDIES[study][1].items() if key.endswith(", told")}
    option = {"images": "dead_time", "commands": "command_delay"}[study]
    assert {options[option] for options in told.values()} == {DEAD_TIME}
    assert all(
        {**LAWS[options["type"]], "type": options["type"]}.items() <= options.items()
        for options in told.values()
    )
