"""What the paper's claims, figures and studies add to the core."""

from pathlib import Path

from ..plugins.registry import Command, Part

_COMMANDS = "vsconstraints.paper.commands"
_PANEL = "The paper, and general questions"

PART = Part(
    commands={
        "reproduce": Command(f"{_COMMANDS}:reproduce", _PANEL, "--figure 9"),
        "study": Command(f"{_COMMANDS}:study", _PANEL, "pareto"),
    },
    options=Path(__file__).with_name("options.toml"),
)
