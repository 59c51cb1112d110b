"""How code is compiled that is never called but as a part of other compiled functions."""

from __future__ import annotations

from importlib import import_module
from typing import Any

codegen = import_module("numba.core.codegen")  # not typed


class Library(codegen.JITCodeLibrary):  # type: ignore[misc, name-defined]
    """Code that stays as it is: those that it is a part of optimise it, and make machine code of it.

    Numba would do both for each part first, for a third of all its time and with the same results.
    """

    _final_module: Any

    def _optimize_final_module(self) -> None:
        """Leave it."""

    def _finalize_final_module(self) -> None:
        """Let machine code be made of nothing but what numba insists on, a place for the environment of each function.

        Nobody reads there: environments serve exceptions with arguments, and Python objects.
        """
        whole, common = self._final_module, codegen.ll.Linkage.common
        places = [one.name for one in whole.global_variables if one.linkage == common]
        self._final_module = codegen.ll.parse_assembly("\n".join(f"@{name} = common global i64 0" for name in places))
        super()._finalize_final_module()
        self._final_module = whole


class Part(import_module("numba.core.compiler").Compiler):  # type: ignore[misc]
    """Compiles with a :class:`Library`."""

    def define_pipelines(self) -> Any:
        """As ever, but for the library."""
        state = self.state
        state.library = Library(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().define_pipelines()
