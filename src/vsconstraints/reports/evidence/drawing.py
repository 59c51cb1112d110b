"""Figures of the report of evidence: drawn into its folder, and shown with a caption."""

from __future__ import annotations

from ...figures import Figure
from .material import Material


def shown(material: Material, figure: Figure, *needed: object) -> str:
    """Draw a figure and show it; whatever goes wrong leaves that figure out, with a sentence why.

    Nothing where there is nothing to show, or figures are not wanted.
    """
    if not material.figures:
        return ""
    folder, file = material.folder / "figures", figure.file_in(material.formats)
    try:
        folder.mkdir(exist_ok=True)
        if not figure.write(folder / file, *needed, formats=material.formats):
            return ""
    except Exception as error:  # a figure must not cost the report
        return f"The figure of {figure.title} could not be drawn: {type(error).__name__}: {error}"
    title = figure.title[0].upper() + figure.title[1:]
    return f"![{title}](figures/{file})\n\n*{figure.caption}*"
