"""What the tests of faults share."""

import pytest

from vsconstraints.kernels import prepare


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    """Commands are killed while they compare: not while they compile, which happens once."""
    prepare()
