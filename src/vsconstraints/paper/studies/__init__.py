"""Studies of the paper's general claims, each with one question, many runs and one figure."""

from .run import CAMPAIGNS, STUDIES, data_file, figure_file, run_studies
from .study import Study, StudyResult
from .summary import RunSummary

__all__ = [
    "CAMPAIGNS",
    "STUDIES",
    "RunSummary",
    "Study",
    "StudyResult",
    "data_file",
    "figure_file",
    "run_studies",
]
