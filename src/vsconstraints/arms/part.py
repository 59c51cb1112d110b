"""What laws on arms add to the core."""

from pathlib import Path

from ..plugins.registry import Command, Listing, Part

PART = Part(
    commands={
        "run": Command(
            "vsconstraints.arms.commands:run",
            "On an arm",
            "ur5-fov --controller cbf-filter --robot loopback://",
        ),
    },
    options=Path(__file__).with_name("options.toml"),
    listings={"arms": Listing("vsconstraints.arms.commands:arms", before="constraints")},
)
