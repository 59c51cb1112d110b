"""``.. package:: vsconstraints.constraints``: complete reference of a package's modules.

References in docstrings lead to the place where an object is defined, whatever public name they
use.
"""

from __future__ import annotations

import builtins
import importlib
import pkgutil
import re
from collections.abc import Iterable, Iterator
from functools import cache
from inspect import signature
from itertools import chain

from docutils import nodes
from listings import meanings
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import make_refnode


def modules(name: str) -> list[str]:
    """Return a module and, if it is a package, the public modules in it; no compiled functions."""
    paths = getattr(importlib.import_module(name), "__path__", ())
    inside = [module.name for module in pkgutil.walk_packages(paths, f"{name}.")]
    public = [module for module in inside if not module.rpartition(".")[2].startswith("_")]
    return [name, *(module for module in public if ".kernels" not in module)]


class Package(SphinxDirective):
    """Directive that documents all modules of the named packages and modules, one section each."""

    required_arguments = 1
    optional_arguments = 30

    def run(self) -> list[nodes.Node]:
        """Write one automodule for each module."""
        lines = []
        for name in (module for package in self.arguments for module in modules(package)):
            short = name.removeprefix("vsconstraints.")
            lines += [short, "-" * len(short), "", f".. automodule:: {name}"]
            lines += ["   :members:", "   :show-inheritance:", "   :ignore-module-all:", ""]
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def _annotation(entries: str) -> re.Pattern[str]:
    parts = re.split(r"(\w+)", f"ndarray[tuple[Any, ...], dtype[{entries}]]")
    # names may occur twice, and with their modules: which form is shown is decided later
    return re.compile(
        "".join(
            rf"(?:{part})?~?(?:\w+\.)?{part}" if part.isalpha() else re.escape(part)
            for part in parts
        )
    )


ARRAYS = {"Array": _annotation("floating[Any]"), "BoolArray": _annotation("bool")}
"""Names of array types in the code, and their form in annotations."""


def name_arrays(
    app: Sphinx,
    what: str,
    name: str,
    thing: object,
    options: object,
    signature: str | None,
    returned: str | None,
) -> tuple[str | None, str | None]:
    """Replace array types in signatures by their names in the code.

    A default from a factory is shown like any default.
    """
    return _named(signature and signature.replace("<factory>", "...")), _named(returned)


def _named(text: str | None) -> str | None:
    for alias, shown in ARRAYS.items():
        text = text and shown.sub(alias, text)
    return text


def tidy(app: Sphinx, domain: str, kind: str, content: addnodes.desc_content) -> None:
    """Replace array types of properties, which are not in a signature.

    "Bases: object" is removed.
    """
    for paragraph in [
        node for node in content.children if node.astext().startswith("Bases: object")
    ]:
        content.remove(paragraph)
    for annotation in list(content.parent.findall(addnodes.desc_annotation)):
        text = annotation.astext()
        named = _named(text) or text
        if named != text:
            annotation.children = []
            annotation += nodes.Text(named)


def as_written(
    app: Sphinx, what: str, name: str, thing: object, settings: object, lines: list[str]
) -> None:
    """Keep bars and colons, which reStructuredText and napoleon interpret; add options."""
    meant = meanings(thing) if what == "class" else {}
    meant = {name: text for name, text in meant.items() if name in signature(thing).parameters}
    if meant:
        lines += [] if "Parameters" in lines else ["", "Parameters", "----------"]
        lines += [line for name, text in meant.items() for line in (name, f"    {text}")]
    text = "\n".join(lines)
    text = re.sub(r"(``.*?``)|\|", lambda found: found[1] or r"\|", text)
    if isinstance(thing, dict):
        text += "\n\n:meta hide-value:"
    if what in ("attribute", "data", "property"):
        # the leading text keeps napoleon from taking the part before the first colon for a type
        text = f"\\ \n{text}"
    lines[:] = text.split("\n")


@cache
def defined_as(name: str) -> str:
    """Full name under which the target of ``name`` was defined; ``name`` itself if unknown."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:end]))
        except ImportError:
            continue
        for i, part in enumerate(parts[end:], start=end):
            owners = getattr(found, "__mro__", ())
            owner = next((base for base in owners if part in vars(base)), None)
            if owner is not None and i == len(parts) - 1:
                return f"{owner.__module__}.{owner.__qualname__}.{part}"
            found = getattr(found, part, None)
        return f"{getattr(found, '__module__', None)}.{getattr(found, '__qualname__', None)}"
    return name


def resolve(
    app: Sphinx, env: BuildEnvironment, node: addnodes.pending_xref, text: nodes.Node
) -> nodes.Node | None:
    """Resolve a reference to the place where the object is defined.

    Names without dots belong to the class or module.
    """
    if node.get("refdomain") != "py" or not all(
        part.isidentifier() for part in node["reftarget"].split(".")
    ):
        return None
    if node["reftarget"].partition(".")[0] in (*dir(builtins), *app.config.other_packages):
        return None
    target, module, inside = (
        str(node.get(key) or "") for key in ("reftarget", "py:module", "py:class")
    )
    documented = env.domains.python_domain.objects
    # as written, in the class, in the module; the only one of this name; for attributes the class,
    # which documents them
    names = [target, *([f"{module}.{inside}.{target}", f"{module}.{target}"] if module else [])]
    names += [f"vsconstraints.rows.{target}"] if target in ARRAYS else []
    for name in chain(
        names,
        _elsewhere(target, documented),
        [f"{module}.{inside}"] * (bool(module) and node["reftype"] == "attr"),
    ):
        for place in (documented.get(name), documented.get(defined_as(name))):
            if place is not None:
                return make_refnode(
                    app.builder, node["refdoc"], place.docname, place.node_id, text, name
                )
    return None


def _elsewhere(target: str, documented: Iterable[str]) -> Iterator[str]:
    for ending in (target, target.rpartition(".")[2]):
        found = [name for name in documented if name.endswith(f".{ending}")]
        if len(found) == 1:
            yield found[0]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive and the handlers of docstrings and names."""
    app.add_directive("package", Package)
    app.add_config_value("other_packages", (), "env")
    app.connect("autodoc-process-docstring", as_written, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", name_arrays)
    app.connect("object-description-transform", tidy)
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
