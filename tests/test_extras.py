"""What only some parts need: named with what installs it where it is missing, and not needed by a comparison."""

import subprocess
import sys

import pytest

from documents import ROOT
from vsconstraints import extras
from vsconstraints.errors import ConfigurationError
from vsconstraints.scenarios.toml import read_toml


def test_what_is_installed_is_not_complained_of() -> None:
    for name in extras.EXTRAS:
        extras.demand(name)


def test_what_is_missing_is_named_with_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda module: None if module in ("optuna", "pandas") else object())
    with pytest.raises(ConfigurationError, match=r"needs pandas, optuna: pip install 'vsconstraints\[tune\]'"):
        extras.demand("tune")
    with pytest.raises(ConfigurationError, match=r"^a chart needs pandas, optuna: "):
        extras.demand("tune", "a chart")
    with pytest.raises(ConfigurationError, match=r"unknown extra 'evidenc'\. Did you mean 'evidence'"):
        extras.demand("evidenc")


def test_extras_are_those_of_the_package() -> None:
    assert set(extras.EXTRAS) < set(read_toml(ROOT / "pyproject.toml")["project"]["optional-dependencies"])


def test_a_comparison_needs_none_of_them() -> None:
    """The command line, with every module of the extras hidden."""
    hidden = sorted({module for extra in extras.EXTRAS.values() for module in extra.modules})
    program = (
        f"import sys; sys.modules.update(dict.fromkeys({hidden!r}))\n"
        "import vsconstraints.cli, vsconstraints.comparisons, vsconstraints.reports, vsconstraints.listing"
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120)
