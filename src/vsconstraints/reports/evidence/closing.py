"""The last parts of the report of evidence: definitions, limitations, machine and rate."""

from __future__ import annotations

from ...comparisons.metrics import DEFINITIONS, NEGLIGIBLE, TOLERANT
from ..markdown import bullets
from ..numbers import DASH, number, of_length
from ..report import command_facts, facts_table, machine_facts
from .material import Material

WORDS = {
    "Success": "The run converged and violated no row. Where nothing else is said rows are violated by the strict "
    f"standard, if deeper outside than {of_length(NEGLIGIBLE)}; by the tolerant one, if deeper than "
    f"{of_length(TOLERANT)}. Both are the same for all laws and rows.",
    "Intervals": "95 %: of rates exact (Clopper and Pearson), of differences of rates on the same scenes Tango's score "
    "interval with continuity correction, of medians of differences the exact one. Intervals of differences between "
    "laws are simultaneous for all pairs of laws in a condition; those of a law's own rate are of each number by "
    "itself.",
    "Distinguishable": "Two laws on the same scenes whose interval does not hold zero, which is the same as a test "
    "corrected for all pairs of laws in a condition (Bonferroni): of rates McNemar's, of numbers the sign test, which "
    "is of the median of the differences where laws differ. Success and violation are tested each by itself. Not "
    "distinguishable does not mean equal: the interval says how much they may differ.",
    "All families": "Scenes of all families together, each of the same weight; only scenes that every law has run.",
    "Failures": "Where costs are compared scene by scene (profiles, ranks), a run without success costs infinitely "
    "much. Medians are over runs with success, those of times over all; nothing is a mean.",
}

SHOWN = (
    "status",
    "violated",
    "within_band",
    "settling_time_s",
    "utilization",
    "acceleration_variation",
    "share_to_hold",
)
"""Metrics whose definitions the report repeats."""

LIMITATIONS = (
    "Simulation only: an arm without dynamics of its own and images without a camera. What disturbs it is what the "
    "families say, and no more.",
    "The shares are those of these families: of other distributions of scenes they are others. Families weigh by their "
    "numbers of scenes.",
    "Scenes in which tracking alone leaves no row were left out: shares are of scenes that are challenged.",
    "Laws have the settings that they come with, but for those that are called tuned. Another setting can change the "
    "order.",
    "Times are those of this machine with other runs beside it.",
    "Whether any law can succeed in a scene is not known. Told are two things that no law can do: hold a row from "
    "where tracking alone meets its boundary, if that takes more than the limits allow; and arrive sooner than in the "
    "least time.",
)


def closing(material: Material) -> str:
    """Everything that a reader needs to judge or repeat the campaign."""
    definitions = {name: DEFINITIONS[name] for name in SHOWN if name in DEFINITIONS}
    return "\n\n".join(
        (
            "## What words mean",
            bullets([f"**{name}**: {text}" for name, text in {**WORDS, **definitions}.items()]),
            "## Known limitations",
            bullets(LIMITATIONS),
            "## Machine and versions",
            _machine(material),
        )
    )


def _machine(material: Material) -> str:
    manifest, configuration = material.manifest, material.configuration
    packages = manifest.get("packages", {})
    wall, runs = manifest.get("wall_time_s"), len(material.evidence.runs)
    rate = manifest.get("runs_per_s") or (runs / wall if wall else None)
    facts = {
        **machine_facts(manifest),
        "packages": ", ".join(f"{name} {version}" for name, version in packages.items()),
        **command_facts(manifest),
        "half, seed": f"{configuration.get('half', DASH)}, {configuration.get('seed', DASH)}",
        "wall time [s]": None if wall is None else number(float(wall)),
        "runs": str(runs),
        "runs per second": None if rate is None else number(float(rate)),
    }
    return facts_table(facts)
