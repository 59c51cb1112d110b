"""Figures of the report of evidence: drawn into its folder, and shown with a caption."""

from __future__ import annotations

from ..drawing import picture
from ..plots import Figure
from .material import Material


def shown(material: Material, figure: Figure, *needed: object) -> str:
    """See :func:`~vsconstraints.reports.picture.picture`; nothing where figures are not wanted."""
    if not material.figures:
        return ""
    return picture(figure, material.folder / "figures", material.formats, *needed)
