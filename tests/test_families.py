"""Families of scenes: what is drawn is what is stated, the same everywhere, and can be run."""

import pytest

from vsconstraints.families import Family, families


@pytest.mark.parametrize("name", families())
def test_a_scene_of_every_family_can_be_set_up_in_every_condition(name):
    family = Family.load(name)
    scene = family.scene(0)
    assert scene.found
    assert scene.challenged
    for condition in family.conditions:
        setup = scene.setup(condition)
        assert setup.check_start() == []
