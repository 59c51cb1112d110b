"""What the compiler is run with."""

from __future__ import annotations

import gc

import pytest

from vsconstraints.kernels import load

pytestmark = pytest.mark.skipif(load("laws") is None, reason="there is no compiler")


@pytest.mark.parametrize("collects", [True, False])
def test_garbage_is_collected_after_compiling_as_it_was_before(collects):
    compile_or_read, before = load("compiler")._compile_or_read, gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        assert not compile_or_read(lambda _: gc.isenabled(), None)
        assert gc.isenabled() == collects
        with pytest.raises(ZeroDivisionError):
            compile_or_read(lambda _: 1 / 0, None)
        assert gc.isenabled() == collects
    finally:
        (gc.enable if before else gc.disable)()
