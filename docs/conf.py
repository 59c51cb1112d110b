"""Sphinx configuration: ``sphinx-build -W docs docs/_build``. Needs no network."""

import sys
from pathlib import Path

import vsconstraints

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "vsconstraints"
author = "The vsconstraints developers"
project_copyright = author
version = release = vsconstraints.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "mathml",
    "gallery",
    "listings",
    "package_reference",
]
exclude_patterns = ["_build", "_gallery"]
html_theme = "furo"
html_title = f"vsconstraints {version}"
html_static_path = ["_static"]
html_css_files = ["style.css"]
html_math_renderer = "mathml"
math_eqref_format = "[{number}]"  # round brackets are the paper's
html_copy_source = False
pygments_style = "friendly"

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4

napoleon_google_docstring = False
napoleon_attr_annotations = False  # they are in the signature
napoleon_custom_sections = [("Attributes", "params_style")]  # several may share a description
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
add_module_names = False

nitpicky = True
# Names of other packages: their inventories are on the network, which a build does not use.
other_packages = (
    "abc",
    "_frozen_importlib",
    "signal",
    "xml",
    "coal",
    "collections",
    "contextlib",
    "enum",
    "gymnasium",
    "inspect",
    "markdown_it",
    "matplotlib",
    "msgspec",
    "multiprocessing",
    "np",
    "numpy",
    "pandas",
    "pathlib",
    "pd",
    "pin",
    "pinocchio",
    "rich",
    "socket",
    "threading",
    "typing",
    "types",
)
suppress_warnings = ["ref.python"]  # in aliases of types, names that two modules define
nitpick_ignore_regex = [
    ("py:.*", rf"({'|'.join(other_packages)})(\..*)?"),
    # compiled when imported, and defined by what they stand for
    ("py:.*", r"vsconstraints\.(compiled|\w+\.kernels)\..*"),
]
nitpick_ignore = [
    ("py:class", "Path"),
    ("py:class", "dict[str"),  # aliases of types with a comma in them
    ("py:class", "tuple[int | None"),
    ("py:class", "vsconstraints.plugins.classes.Base"),  # type variables
    ("py:class", "vsconstraints.comparisons.runs.folder.Line"),
    ("py:class", "vsconstraints.comparisons.experiment.Own"),
    ("py:class", "vsconstraints.comparisons.runs.pool.Key"),
    ("py:class", "vsconstraints.comparisons.runs.pool.Answer"),
    ("py:obj", "vsconstraints.comparisons.runs.pool.Answer"),
    ("py:class", "vsconstraints.plugins.registry.Value"),
    ("py:class", "AbstractContextManager"),
    ("py:class", "ReportOptions"),  # of the command line, which the reference leaves out
    ("py:class", "vsconstraints.formulas.F"),
    ("py:class", "vsconstraints.controllers.ranges.Known"),
    ("py:class", "vsconstraints.scenarios.reading.Made"),
    ("py:class", "vsconstraints.bench.reports.dataset.Value"),
    ("py:class", "vsconstraints.reports.markdown.Value"),
    ("py:class", "Random"),  # aliases of types
    ("py:class", "Lens"),
    ("py:class", "Vector"),
    ("py:class", "Formula"),
    ("py:class", "MarkdownIt"),
    ("py:class", "ArrayLike"),  # of NumPy, where other names are there for type checkers only
    (
        "py:func",
        "superellipse",
    ),  # in docstrings of formulas, where classes of other modules have them as theirs
    ("py:class", "Triangles"),  # an array of whole numbers
    ("py:class", "LawArrays"),  # of vsconstraints.compiled, named for type checkers only
    ("py:class", "RowTemplate"),
]
