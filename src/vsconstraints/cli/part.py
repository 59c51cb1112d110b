"""Commands and listings of the core itself."""

from pathlib import Path

from ..plugins.registry import Command, Listing, Part

_RESULTS = "vsconstraints.cli.results"
_LISTING = "vsconstraints.cli.listing"
_PANEL = "Laws in a few scenes"

PART = Part(
    commands={
        "compare": Command(
            f"{_RESULTS}:compare", _PANEL, "--scenario ur5-fov --controller cbf-filter"
        ),
        "list": Command(f"{_RESULTS}:list_", _PANEL, "laws"),
        "report": Command(f"{_RESULTS}:report", _PANEL, "vsconstraints-results --latex"),
        "verify": Command(f"{_RESULTS}:verify", _PANEL, "vsconstraints-results"),
    },
    options=Path(__file__).with_name("options.toml"),
    listings={
        "scenarios": Listing(f"{_LISTING}:scenarios"),
        "laws": Listing(f"{_LISTING}:laws"),
        "demands": Listing(f"{_LISTING}:demands"),
        "resolvers": Listing(f"{_LISTING}:resolvers"),
        "solvers": Listing(f"{_LISTING}:solvers"),
        "robots": Listing(f"{_LISTING}:robots"),
        "constraints": Listing(f"{_LISTING}:constraints"),
        "features": Listing(f"{_LISTING}:features"),
        "shapes": Listing(f"{_LISTING}:shapes"),
        "metrics": Listing(f"{_LISTING}:metrics"),
    },
    results={"a comparison": f"{_RESULTS}:COMPARISON"},
)
