"""Compile all functions of the package that have signatures, or find them compiled."""

from importlib import import_module
from pathlib import Path

import vsconstraints
from vsconstraints import compiled
from vsconstraints.compiled.cache import sources

PACKAGE = Path(vsconstraints.__file__).parent

compiled.prepare()
for source in sources():
    if source.parent.name in ("compiled", "kernels"):
        name = ".".join(source.relative_to(PACKAGE.parent).with_suffix("").parts)
        import_module(name.removesuffix(".__init__"))
