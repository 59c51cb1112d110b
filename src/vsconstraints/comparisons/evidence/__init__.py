"""Evidence: thousands of drawn scenes, run with every law, scored where they are run, and stored as Parquet shards."""

from ..runs.folder import Keep
from ..runs.pool import OpenWorkers, Workers, processes
from .campaign import Campaign
from .folder import RunKey
from .merge import Merged, merge
from .parquet import KEYS, ROWS, RUNS, SCENES, TABLES, TIMING, Column
from .runner import Finished, Plan, Progress, collect
from .stored import Evidence
from .work import Batch, Part, Shard, scored

__all__ = [
    "KEYS",
    "ROWS",
    "RUNS",
    "SCENES",
    "TABLES",
    "TIMING",
    "Batch",
    "Campaign",
    "Column",
    "Evidence",
    "Finished",
    "Keep",
    "Merged",
    "OpenWorkers",
    "Part",
    "Plan",
    "Progress",
    "RunKey",
    "Shard",
    "Workers",
    "collect",
    "merge",
    "processes",
    "scored",
]
