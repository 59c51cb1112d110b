"""Custom controllers, constraints and features: ``module:Class`` or ``FOLDER/FILE.py:Class``."""

from __future__ import annotations

import importlib
import importlib.util
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import chdir, contextmanager
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import TypeVar, cast

from ..errors import ConfigurationError, described, format_value
from .provenance import noted_import

Base = TypeVar("Base")

OF_PACKAGE = f"{__name__.partition('.')[0]}."  #: Beginning of the names of the package's modules.
#: Module of classes defined in a notebook or a running script; it differs between processes.
IN_SESSION = "__main__"


def imported_class(name: str, base: Callable[..., Base], folder: Path | None = None) -> type[Base]:
    """Import the class that a name denotes, which must be derived from ``base``.

    The name is ``"my_laws:Cautious"``, whose ``my_laws.py`` is first searched for in ``folder``, or
    the path of a file with the class, ``"controllers/cautious.py:Cautious"``. Relative paths begin
    in ``folder``, without one in the working directory. Raises ConfigurationError if the file does
    not exist, if the module cannot be imported, or if it does not contain such a class.
    """
    where, class_name = _split(name)
    module_name = module_of(name)
    file = plugin_file(name, folder)
    if file is None and _is_path(where):
        raise ConfigurationError(f"{name!r}: there is no file {_path_of(where, folder).absolute()}")
    try:
        # chdir: the module may change the working directory, which is then restored
        with chdir("."), noted_import(module_name):
            module = importlib.import_module(module_name) if file is None else _module_from(file)
    # a custom module can fail in any way while it is imported
    except (Exception, SystemExit) as error:
        raise ConfigurationError(
            f"{name!r}: cannot import {module_name!r}: {described(error)}"
        ) from error
    found = getattr(module, class_name, None)
    kind = cast("type[Base]", base)
    if not (isinstance(found, type) and issubclass(found, kind)):
        raise ConfigurationError(
            f"{name!r}: {module_name} has no {kind.__name__} named {class_name!r}"
        )
    return found


@contextmanager
def beside(*folders: Path | None) -> Iterator[None]:
    """Allow imports of modules in these folders within the block.

    Modules of the same names elsewhere in ``sys.path`` take precedence, then those of the folders
    in their order. Custom modules may import their neighbours at any time, and Python searches only
    ``sys.path``.
    """
    searched = dict.fromkeys(str(folder.resolve()) for folder in folders if folder)
    added = [path for path in searched if path not in sys.path]
    sys.path += added
    try:
        yield
    finally:
        for path in added:
            if path in sys.path:
                sys.path.remove(path)


def plugin_file(name: str, folder: Path | None) -> Path | None:
    """Return the file that a name denotes, see :func:`imported_class`.

    None for an installed module, and for a file that does not exist.
    """
    where = _split(name)[0]
    if _is_path(where):
        file = _path_of(where, folder)
    elif folder is not None and not where.startswith(OF_PACKAGE):
        file = folder / f"{where.replace('.', '/')}.py"
    else:
        return None
    return file if file.is_file() else None


def module_of(name: str) -> str:
    """Return the name of the module that a name denotes, for messages and for names of files."""
    where = _split(name)[0]
    return Path(where).stem if _is_path(where) else where


def folder_of_neighbours(name: str, folder: Path | None) -> Path | None:
    """Return the folder from which the code of a class imports other custom modules.

    It is that of the file for a path, and ``folder`` for ``module:Class`` and registered names.
    """
    where = name.rpartition(":")[0]
    # as at its import, the real folder of a file that is a link
    return _path_of(where, folder).resolve().parent if _is_path(where) else folder


def module_files(names: Iterable[str], folder: Path | None) -> list[Path]:
    """Return the files of the modules of classes, see :func:`imported_class`.

    Modules without a file are left out.
    """
    files = []
    for name in names:
        if ":" in name:
            file = plugin_file(name, folder)
            module = _split(name)[0]
            spec = spec_of(module) if file is None and module != IN_SESSION else None
            origin = spec.origin if spec is not None and spec.has_location else None
            files += [Path(path) for path in (file, origin) if path is not None]
    return files


def spec_of(module: str) -> ModuleSpec | None:
    """Find the specification of a module without running code; None if it does not exist.

    ``importlib.util.find_spec`` would import the packages that contain the module.
    """
    name = ""
    path = None
    spec = None
    for part in module.split("."):
        name = f"{name}.{part}" if name else part
        found = (finder.find_spec(name, path) for finder in sys.meta_path)
        spec = next((each for each in found if each is not None), None)
        if spec is None:
            return None
        path = spec.submodule_search_locations
    return spec


def code_named(value: object, names_class: bool = False) -> Iterator[str]:
    """Yield every custom class that is named as a type or a feature in nested tables.

    Classes of this package are trusted. ``names_class`` is True inside a type or a feature.
    """
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from code_named(inner, names_class or key in ("type", "feature", "features"))
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from code_named(inner, names_class)
    elif names_class and isinstance(value, str) and ":" in value and not _is_of_package(value):
        yield value


def untrusted(what: str, names: Iterable[str]) -> ConfigurationError:
    """Return the error for stored results that name code, which runs only if they are trusted."""
    code = ", ".join(map(format_value, dict.fromkeys(names)))
    return ConfigurationError(
        f"{what} needs code that the results name, {code}: give --trust (trust=True) to run it"
    )


def _split(name: str) -> tuple[str, str]:
    """Split a name into its module or path and its class.

    Raises ConfigurationError if it has not this form.
    """
    where, _, class_name = name.rpartition(":")
    is_module = re.fullmatch(r"\w+(\.\w+)*", where) is not None
    if not ((is_module or _is_path(where)) and re.fullmatch(r"\w+", class_name)):
        raise ConfigurationError(
            f"{name!r} must be module:Class or FILE.py:Class, for example my_laws:Cautious or "
            "controllers/cautious.py:Cautious"
        )
    return where, class_name


def _is_of_package(name: str) -> bool:
    """True if a name denotes a class of this package, which no file beside results replaces."""
    where = name.rpartition(":")[0]
    return where.startswith(OF_PACKAGE) and not _is_path(where)


def _is_path(where: str) -> bool:
    return where.endswith(".py") and "\0" not in where


def _path_of(where: str, folder: Path | None) -> Path:
    return (folder or Path()) / where


def _module_from(file: Path) -> ModuleType:
    """Import a file under a unique name, so that files of equal names in two folders stay separate.

    The name has no dots. With dots, the module would seem to be in a package, and none of its
    objects could be pickled.
    """
    path = file.resolve()
    unique = f"vsconstraints own file {path}".replace(".", "%2E")
    if unique not in sys.modules:
        spec = importlib.util.spec_from_file_location(unique, path)
        if spec is None or spec.loader is None:
            raise ImportError(f"{path} is not a Python file")
        sys.modules[unique] = module = importlib.util.module_from_spec(spec)
        try:
            with beside(path.parent):
                spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[unique]
            raise
    return sys.modules[unique]
