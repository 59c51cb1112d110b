"""Search for the mesh files of a URDF.

Meshes are searched beside the file, in the folders above it, in given folders, and in ROS's
folders.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

from ..errors import ConfigurationError, format_value
from ..plugins.regular_files import read_regular

IN_PACKAGES = ("package", "model")  #: Schemes whose first folder is the name of a package.
DEPTH = 3  #: Depth to which packages are searched below a folder of ``ROS_PACKAGE_PATH``.


def mesh_folders(
    urdf: Path, package_dirs: Sequence[str | Path] | None, environment: Mapping[str, str]
) -> list[Path]:
    """Return the folders in which packages are searched, in this order.

    ``package_dirs`` are folders of packages, or packages; if None, all folders above the file. They
    are followed by every ``PREFIX/share`` of ``AMENT_PREFIX_PATH`` and by the folders of
    ``ROS_PACKAGE_PATH`` with the subfolders that hold packages.
    """
    named = urdf.resolve().parents if package_dirs is None else package_dirs
    folders = [Path(folder) for folder in named]
    for prefix in _paths(environment, "AMENT_PREFIX_PATH"):
        folders.append(Path(prefix) / "share")
    for path in _paths(environment, "ROS_PACKAGE_PATH"):
        folders.extend(_holding(Path(path), DEPTH))
    # without repetitions
    return list(dict.fromkeys(folders))


def found_mesh(name: str, urdf: Path, folders: Sequence[str | Path]) -> Path | None:
    """Return the file of a mesh's name in a URDF; None if it does not exist.

    ``package://PACKAGE/PATH`` is searched in the folders, ``file://PATH`` is a path. A name without
    a scheme is searched beside the URDF, in the folders, and in the current folder.
    """
    scheme, separator, path = name.rpartition("://")
    searched = [Path(folder) for folder in folders]
    places = []
    if scheme == "file":
        places = [Path(path)]
    elif scheme in IN_PACKAGES:
        path = path.lstrip("/")
        package, _, inside = path.partition("/")
        places = [folder / path for folder in searched]
        # a folder may be the package itself
        places += [folder / inside for folder in searched if folder.name == package]
    elif not separator:
        current = Path()
        places = [folder / name for folder in (urdf.parent, *searched, current)]
    for place in places:
        if place.is_file():
            return place
    return None


def mesh_files(urdf: Path, folders: Sequence[str | Path]) -> list[Path]:
    """Return the existing mesh files of a URDF's collision geometry; empty if it cannot be read."""
    try:
        root = ElementTree.fromstring(read_regular(urdf))
    except (OSError, ValueError, LookupError, ElementTree.ParseError):
        return []
    names = {mesh.get("filename", "") for mesh in _meshes(root)}
    files = [found_mesh(name, urdf, folders) for name in sorted(names)]
    return [file for file in files if file is not None]


Purpose = Literal["collision", "visual"]  #: Purpose of the geometry of a URDF's links.


def with_whole_paths(
    text: str, urdf: Path, folders: Sequence[str | Path], purpose: Purpose = "collision"
) -> str:
    """Return the XML of a URDF with mesh names of a purpose replaced by the paths of their files.

    The scale of a mesh is converted to metres: it is multiplied by the unit of length that a
    COLLADA file states. Raises ConfigurationError, which names the mesh, its link and a remedy, if
    there is no such file.
    """
    root = ElementTree.fromstring(text)
    for link in root.iter("link"):
        for mesh in _meshes(link, purpose):
            name = mesh.get("filename", "")
            file = found_mesh(name, urdf, folders)
            if file is None:
                places = ", ".join(map(str, folders)) or "no folder"
                raise ConfigurationError(
                    f"{urdf}: the link {link.get('name')!r} has the mesh {name!r}, which is not "
                    f"there (looked for in {places}). package_dirs or ROS_PACKAGE_PATH name "
                    "folders of packages; with link_radius, links are capsules and need no mesh"
                )
            mesh.set("filename", str(file.resolve()))
            unit = unit_of_mesh(file)
            if unit != 1.0:
                factors = mesh.get("scale", "1 1 1").split()
                in_metres = [repr(unit * float(factor)) for factor in factors]
                mesh.set("scale", " ".join(in_metres))
    return ElementTree.tostring(root, encoding="unicode")


def unit_of_mesh(file: Path) -> float:
    """Return the metres per unit of length of a mesh file.

    A COLLADA file states them in ``<unit meter="…">``; for other files they are 1. The mesh loader
    ignores that unit, and the file's ``<up_axis>``. ROS's viewer RViz applies the unit and ignores
    the axis, too, so that meshes that look right there are right here. A file that is no XML has
    the unit 1: reading its geometry reports the error. Raises ConfigurationError if the unit is not
    a positive number.
    """
    if file.suffix.lower() != ".dae":
        return 1.0
    stated = _stated_unit(file)
    try:
        unit = float(stated)
    except ValueError:
        unit = math.nan
    if not 0.0 < unit < math.inf:
        raise ConfigurationError(
            f'{file}: <unit meter="…"> must be a positive number of metres per unit of length, '
            f"not {format_value(stated)}"
        )
    return unit


def _stated_unit(file: Path) -> str:
    """Return the text of the unit in the asset of the whole COLLADA file.

    The asset stands before the geometry.
    """
    open_elements: list[str] = []
    try:
        # iterparse closes a file that it opens itself only if it is read to its end
        with file.open("rb") as stream:
            for event, element in ElementTree.iterparse(stream, events=("start", "end")):
                tag = element.tag.rpartition("}")[2].lower()
                if event == "end":
                    open_elements.pop()
                    if tag == "asset":
                        break
                    continue
                if tag == "unit" and open_elements == ["collada", "asset"]:
                    return str(element.get("meter", "1"))
                open_elements.append(tag)
    except (OSError, ElementTree.ParseError):
        pass
    return "1"


def _meshes(
    root: ElementTree.Element, purpose: Purpose = "collision"
) -> Iterator[ElementTree.Element]:
    return (mesh for part in root.iter(purpose) for mesh in part.iter("mesh"))


def _paths(environment: Mapping[str, str], variable: str) -> list[str]:
    return [path for path in environment.get(variable, "").split(os.pathsep) if path]


def _holding(folder: Path, depth: int) -> Iterator[Path]:
    """Yield the folder above a package, or every folder that may hold packages."""
    if _is_package(folder):
        yield folder.parent
        return
    yield folder
    if depth > 1:
        try:
            inside = [path for path in folder.iterdir() if path.is_dir()]
        except OSError:  # missing, or without permission to read
            return
        for path in sorted(inside):
            is_hidden = path.name.startswith(".")
            if not is_hidden and not _is_package(path):
                yield from _holding(path, depth - 1)


def _is_package(folder: Path) -> bool:
    return (folder / "package.xml").is_file() or (folder / "manifest.xml").is_file()
