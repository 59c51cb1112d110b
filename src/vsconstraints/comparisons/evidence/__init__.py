"""Evidence: thousands of drawn scenes, run with every law, scored where they are run, and stored as Parquet shards."""

from ..runs.keep import Keep
from .campaign import Campaign
from .columns import KEYS, ROWS, RUNS, SCENES, TABLES, TIMING, Column
from .merge import Merged, merge
from .progress import Finished, Progress
from .runner import Plan, collect
from .stored import Evidence
from .task import Batch, Shard
from .trajectories import RunKey
from .worker import Part, scored
from .workers import OpenWorkers, Workers, processes

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
