"""Evidence: run every law on thousands of drawn scenes and store the scores.

Runs are scored in the process that makes them. The results of each batch of scenes are
stored in Parquet files.
"""

from ...comparisons.runs.folder import Keep
from ...comparisons.runs.pool import processes
from .call_times import MEASURED, CallTimes, call_times
from .campaign import Campaign
from .merge import merge
from .runner import Plan, Progress, collect
from .stored import Evidence
from .work import Batch, Part, Shard, scored

__all__ = [
    "MEASURED",
    "Batch",
    "CallTimes",
    "Campaign",
    "Evidence",
    "Keep",
    "Part",
    "Plan",
    "Progress",
    "Shard",
    "call_times",
    "collect",
    "merge",
    "processes",
    "scored",
]
