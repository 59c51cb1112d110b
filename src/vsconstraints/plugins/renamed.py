"""Old words for arguments: they still work, with a note that tells the new one."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

Made = TypeVar("Made", bound=Callable[..., Any])


def renamed(**words: str | tuple[str, dict[Any, Any]]) -> Callable[[Made], Made]:
    """Let a class or a function take old keyword arguments, given as old to new, with a DeprecationWarning.

    Where the values have changed, too, new is the word and what stands for each old value.
    """

    def decorate(make: Made) -> Made:
        plain: Any = make.__init__ if isinstance(make, type) else make  # type: ignore[misc]

        @wraps(plain)
        def call(*arguments: Any, **options: Any) -> Any:
            for old in words.keys() & options.keys():
                word = words[old]
                new, values = (word, {}) if isinstance(word, str) else word
                name = type(arguments[0]).__name__ if isinstance(make, type) else make.__name__
                note = f"{name}: the argument {old} is now called {new}"
                warnings.warn(note, DeprecationWarning, stacklevel=2)
                value = options.pop(old)
                options[new] = values[value] if values else value
            return plain(*arguments, **options)

        if isinstance(make, type):
            make.__init__ = call  # type: ignore[misc]
            return make
        return call  # type: ignore[return-value]

    return decorate
