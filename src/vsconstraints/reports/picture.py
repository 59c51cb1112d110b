"""One figure of a report: drawn into its folder, and shown with a caption."""

from __future__ import annotations

from pathlib import Path

from .plots import Figure, Formats


def picture(figure: Figure, folder: Path, formats: Formats, *needed: object, suffix: str = "", remark: str = "") -> str:
    """Draw a figure into ``folder`` and show it; whatever goes wrong leaves it out, with a sentence why.

    Nothing where there is nothing to show. The ``suffix`` ends the file's name, and the ``remark`` the caption.
    """
    file = figure.file_in(formats, suffix)
    try:
        folder.mkdir(exist_ok=True)
        if not figure.write(folder / file, *needed, formats=formats):
            return ""
    except Exception as error:  # a figure must not cost the report
        return f"The figure of {figure.title} could not be drawn: {type(error).__name__}: {error}"
    title = figure.title[0].upper() + figure.title[1:]
    return f"![{title}](figures/{file})\n\n*{figure.caption}{remark}*"
