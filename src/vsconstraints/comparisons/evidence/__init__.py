"""Evidence: thousands of drawn scenes, run with every law, scored where they are run, and stored as Parquet shards."""

from ..runs.folder import Keep
from ..runs.pool import processes
from .campaign import Campaign
from .merge import merge
from .parquet import KEYS, RUNS, SCENES, TABLES, TIMING
from .runner import Finished, Plan, Progress, collect
from .stored import Evidence
from .work import Batch, Part, Shard, scored

__all__ = [
    "KEYS",
    "RUNS",
    "SCENES",
    "TABLES",
    "TIMING",
    "Batch",
    "Campaign",
    "Evidence",
    "Finished",
    "Keep",
    "Part",
    "Plan",
    "Progress",
    "Shard",
    "collect",
    "merge",
    "processes",
    "scored",
]
