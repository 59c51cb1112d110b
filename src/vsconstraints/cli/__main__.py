"""Entry point of ``python -m vsconstraints.cli``."""

from . import main

main()
