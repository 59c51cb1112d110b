"""What only some parts need: named with what installs it where it is missing, and not needed by a
comparison.
"""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from documents import ROOT
from vsconstraints.comparisons.runs import machine
from vsconstraints.errors import ConfigurationError
from vsconstraints.plugins import extras
from vsconstraints.scenarios.toml import read_toml


@pytest.mark.parametrize("name", extras.EXTRAS)
def test_what_is_installed_is_not_complained_of(name: str) -> None:
    # which have no wheels for some machines, or need not be there
    if name in ("bags", "gym", "physics", "ur-rtde"):
        for module in extras.EXTRAS[name].modules:
            pytest.importorskip(module)
    extras.demand(name)


def test_what_is_missing_is_named_with_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        extras, "find_spec", lambda module: None if module in ("optuna", "pandas") else object()
    )
    with pytest.raises(
        ConfigurationError, match=r"needs pandas, optuna: pip install 'vsconstraints\[tune\]'"
    ):
        extras.demand("tune")
    with pytest.raises(ConfigurationError, match=r"^a chart needs pandas, optuna: "):
        extras.demand("tune", "a chart")
    with pytest.raises(
        ConfigurationError, match=r"unknown extra 'evidenc'\. Did you mean 'evidence'"
    ):
        extras.demand("evidenc")


def test_extras_are_those_of_the_package() -> None:
    assert set(extras.EXTRAS) < set(
        read_toml(ROOT / "pyproject.toml")["project"]["optional-dependencies"]
    )


@pytest.mark.parametrize(
    "command", ["compare --scenario example-2d-fov --controller tracking", "report", "verify"]
)
def test_a_comparison_needs_none_of_them(command: str, tmp_path: Path) -> None:
    """The command line, with every module of the extras hidden; other processes, which make the
    runs, see them.
    """
    hidden = sorted({module for extra in extras.EXTRAS.values() for module in extra.modules})
    short = "--set scenario.duration=0.1 --no-figures"
    commands = [f"compare --scenario example-2d-fov --controller tracking {short} --out {tmp_path}"]
    commands += [] if command.startswith("compare") else [f"{command} {tmp_path}"]
    program = f"""
import sys
sys.modules.update(dict.fromkeys({hidden!r}))
if __name__ == "__main__":
    import vsconstraints.cli, vsconstraints.comparisons, vsconstraints.reports, vsconstraints.cli.listing
    for command in {commands!r}:
        sys.argv = ["vsconstraints", *command.split()]
        try:
            vsconstraints.cli.main()
        except SystemExit as end:
            assert not end.code, command
"""
    (tmp_path.parent / "program.py").write_text(program)
    subprocess.run([sys.executable, str(tmp_path.parent / "program.py")], check=True, timeout=120)


def test_every_package_that_is_imported_is_in_some_identity() -> None:
    """Of what the source imports, wherever it does: what is required, or told where a configuration
    uses it.
    """
    found = set()
    paths = set((ROOT / "src").rglob("*.py"))
    # programs of their own, in environments of their own
    paths -= set((ROOT / "src" / "vsconstraints" / "stacks" / "adapters").rglob("*.py"))
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found.add(str(node.module).partition(".")[0])
    found -= {*sys.stdlib_module_names, "vsconstraints"}
    known = {*machine.package_versions(), *machine.OUTPUT_ONLY}
    required = {
        name for name in found if machine.module_version(name).partition(" ")[0].lower() in known
    }
    extra = {module for one in extras.EXTRAS.values() for module in one.modules}
    assert {"numpy", "pinocchio", "coal", "yaml"} <= required
    # what only draws or shows, dask, which is one with distributed, and markupsafe, which is one
    # with jinja2
    assert found - required - extra <= {
        "PIL",
        "mpl_toolkits",
        "trimesh",
        "IPython",
        "dask",
        "jinja2",
        "markupsafe",
    }
