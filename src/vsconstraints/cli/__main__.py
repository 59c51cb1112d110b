"""``python -m vsconstraints.cli``."""

from . import main

main()
