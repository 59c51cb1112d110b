"""Part ``score``: the command that scores recorded runs."""

from pathlib import Path

from ..plugins.registry import Command, Part

PART = Part(
    commands={
        "score": Command(
            "vsconstraints.score.commands:score", "Recorded runs", "run.csv --scenario ur5-fov"
        ),
    },
    options=Path(__file__).with_name("options.toml"),
)
