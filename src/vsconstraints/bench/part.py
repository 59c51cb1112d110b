"""Part ``bench``: families of drawn scenes, campaigns, tuning, advice and test sets."""

from pathlib import Path

from ..plugins.registry import Command, Group, Listing, Part

_CAMPAIGNS = "vsconstraints.bench.commands.campaigns"
_TESTSET = "vsconstraints.bench.commands.testset"
_PANEL = "Thousands of drawn scenes"

PART = Part(
    commands={
        "diff": Command(
            "vsconstraints.bench.commands.difference:diff",
            "Laws in a few scenes",
            "before after --metric settling_time_s",
            before="verify",
        ),
        "families": Command(f"{_CAMPAIGNS}:families", _PANEL, "six-axis --scenes 20"),
        "evidence": Command(f"{_CAMPAIGNS}:evidence", _PANEL, "--family six-axis --scenes 50"),
        "merge": Command(f"{_CAMPAIGNS}:merge", _PANEL, "whole part-1 part-2"),
        "advise": Command(f"{_CAMPAIGNS}:advise", _PANEL, "ur5-fov"),
        "tune": Command(f"{_CAMPAIGNS}:tune", _PANEL, "--family six-axis --controller cbf-filter"),
        "testset run": Command(
            f"{_TESTSET}:run", _PANEL, "--family planar-arm --entry my_law:MyLaw"
        ),
        "testset fresh": Command(f"{_TESTSET}:fresh", _PANEL, "--scenes 20 --out fresh"),
        "testset verify": Command(f"{_TESTSET}:verify", _PANEL, "--redraw 0.01"),
        "testset leaderboard": Command(
            f"{_TESTSET}:leaderboard", _PANEL, "mine.parquet --rerun 0.01"
        ),
        "testset make": Command(
            f"{_TESTSET}:make", _PANEL, "--scenes 50 --seed 7 --out my-testset"
        ),
    },
    groups={
        "testset": Group("Run laws on a frozen test set, check it, or make one.", "run --scenes 20")
    },
    options=Path(__file__).parent / "commands" / "options.toml",
    listings={"families": Listing(f"{_CAMPAIGNS}:listed_families", before="laws")},
    results={"evidence": "vsconstraints.bench.commands.stored:CAMPAIGN"},
)
