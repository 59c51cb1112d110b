"""Own controllers and constraints named in files as ``module:Class``."""

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

from ..errors import ConfigurationError, described, shown
from .provenance import noted_import

Base = TypeVar("Base")

#: The module of what is defined in a notebook or a script that runs; other processes have another
#: one.
IN_SESSION = "__main__"


def imported_class(name: str, base: Callable[..., Base], folder: Path | None = None) -> type[Base]:
    """The class derived from ``base`` that ``"my_laws:Cautious"`` names; ``my_laws.py`` is first
    sought in ``folder``.

    Raises ConfigurationError if the module cannot be imported, or holds no such class.
    """
    module_name, class_name = _parts(name)
    file = plugin_file(name, folder)
    try:
        with chdir("."), noted_import(module_name):
            module = importlib.import_module(module_name) if file is None else _module_from(file)
    # an own module can fail in any way while it is imported
    except (Exception, SystemExit) as error:
        raise ConfigurationError(
            f"{name!r}: cannot import {module_name!r}: {described(error)}"
        ) from error
    own = getattr(module, class_name, None)
    kind = cast("type[Base]", base)
    if not (isinstance(own, type) and issubclass(own, kind)):
        raise ConfigurationError(
            f"{name!r}: {module_name} holds no {kind.__name__} of the name {class_name!r}"
        )
    return own


@contextmanager
def beside(*folders: Path | None) -> Iterator[None]:
    """Modules in these folders can be imported meanwhile, where no other of their names comes
    first.

    Own modules import their neighbours whenever they like, for which Python looks nowhere but in
    ``sys.path``.
    """
    added = {str(folder.resolve()) for folder in folders if folder} - set(sys.path)
    sys.path += added
    try:
        yield
    finally:
        for path in added.intersection(sys.path):
            sys.path.remove(path)


def plugin_file(name: str, folder: Path | None) -> Path | None:
    """The file in ``folder`` that ``module:Class`` means; None if it means an installed module."""
    file = None if folder is None else folder / f"{_parts(name)[0].replace('.', '/')}.py"
    return file if file is not None and file.is_file() else None


def module_files(names: Iterable[str], folder: Path | None) -> list[Path]:
    """The files of the modules that these names of parts name as ``module:Class``, where they have
    one.
    """
    files = []
    for name in names:
        if ":" in name:
            file = plugin_file(name, folder)
            module = _parts(name)[0]
            spec = _spec_of(module) if file is None and module != IN_SESSION else None
            origin = spec.origin if spec is not None and spec.has_location else None
            files += [Path(path) for path in (file, origin) if path is not None]
    return files


def _spec_of(module: str) -> ModuleSpec | None:
    """As ``importlib.util.find_spec``, which imports the packages that a module lies in: here no
    code is run.
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


def code_named(tables: object, typed: bool = False) -> Iterator[str]:
    """Every ``module:Class`` that nested tables name as the ``type`` of something."""
    if isinstance(tables, Mapping):
        for key, inner in tables.items():
            yield from code_named(inner, typed or key == "type")
    elif isinstance(tables, list | tuple):
        for inner in tables:
            yield from code_named(inner, typed)
    elif typed and isinstance(tables, str) and ":" in tables:
        yield tables


def untrusted(what: str, names: Iterable[str]) -> ConfigurationError:
    """Error for what cannot be had of stored results since it takes code that they name, which
    reading does not run.
    """
    code = ", ".join(map(shown, dict.fromkeys(names)))
    return ConfigurationError(
        f"{what} needs code that is named there, {code}: it runs with --trust alone (trust=True)"
    )


def _parts(name: str) -> list[str]:
    if not re.fullmatch(r"\w+(\.\w+)*:\w+", name):
        raise ConfigurationError(f"{name!r} must be module:Class, for example my_laws:Cautious")
    return name.split(":")


def _module_from(file: Path) -> ModuleType:
    """Import a file under a name of its own, so that files of the same name in two folders stay
    apart.

    The name has no dots, with which it would seem to be in a package, and nothing of it could be
    pickled.
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
