"""What claims are measured on: runs as they are asked for and as they have been made."""

from ..comparisons.run import MERGE, Run, kept_run, perform
from ..runs.spec import BASELINE, ControllerSpec, RunSpec

__all__ = ["BASELINE", "MERGE", "ControllerSpec", "Run", "RunSpec", "kept_run", "perform"]
