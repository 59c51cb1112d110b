"""Claims of the paper, one function for each sentence; importing registers them."""

from ..verdicts import CLAIMS, all_claims
from . import (
    appendices,
    section_3_invariance,
    section_4_approach,
    section_5_remarks,
    section_6_advantages,
    section_8_image_border,
    section_8_obstacles,
    section_9_case_study,
    section_10_experiments,
)

__all__ = [
    "CLAIMS",
    "all_claims",
    "appendices",
    "section_3_invariance",
    "section_4_approach",
    "section_5_remarks",
    "section_6_advantages",
    "section_8_image_border",
    "section_8_obstacles",
    "section_9_case_study",
    "section_10_experiments",
]
