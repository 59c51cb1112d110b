"""What the tests of faults share."""

import pytest

from vsconstraints.compiled import prepare


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    """Commands are killed while they compare: not while they compile, which happens once."""
    prepare()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--times", type=int, default=1, help="how often each signal is sent to each target"
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "k" in metafunc.fixturenames:
        # without this file's option where the folder was not named
        metafunc.parametrize("k", range(metafunc.config.getoption("--times", default=1)))
