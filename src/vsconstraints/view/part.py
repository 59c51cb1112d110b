"""Registration of previews, replays and films: their commands, and a section of reports."""

from pathlib import Path

from ..plugins.registry import Command, Part

_COMMANDS = "vsconstraints.view.commands"
_PANEL = "A look at a scene, or at a run of it"

PART = Part(
    commands={
        "preview": Command(f"{_COMMANDS}:preview", _PANEL, "ur5-fov"),
        "replay": Command(f"{_COMMANDS}:replay", _PANEL, "ur5-fov:tracking ur5-fov:sliding-mode"),
        "frames": Command(f"{_COMMANDS}:frames", _PANEL, "ur5-images --out images.gif"),
    },
    options=Path(__file__).with_name("options.toml"),
    report_sections={"replay": "vsconstraints.view.replay.section:replay_section"},
)
