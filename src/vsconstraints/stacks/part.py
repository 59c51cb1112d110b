"""Part ``stacks``: external programs as controllers, and a list of the adapters."""

from __future__ import annotations

from ..plugins.registry import Listing, Part


def listed_adapters() -> list[tuple[str, ...]]:
    """Return names and descriptions of the adapters, with the packages that each needs."""
    from .environments import requirements
    from .external import adapters, description

    return [
        (name, description(name), f"packages: {', '.join(requirements(name))}")
        for name in adapters()
    ]


PART = Part(
    controllers={"stack": "vsconstraints.stacks:ExternalStack"},
    listings={"adapters": Listing("vsconstraints.stacks.part:listed_adapters", "solvers")},
)
