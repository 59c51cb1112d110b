"""Studies: the paper's general claims, each as one question, many runs and one figure."""

from .gradient_error import GradientErrors
from .non_static import NonStatic
from .pareto import Pareto
from .robustness import Robustness
from .run import data_file, figure_file, run_studies
from .sampling_time import SamplingTime
from .shrinking_region import ShrinkingRegion
from .study import Study, StudyResult
from .summary import RunSummary
from .switching_gain import SwitchingGain
from .unselected_experiments import UnselectedExperiments

__all__ = [
    "STUDIES",
    "RunSummary",
    "Study",
    "StudyResult",
    "data_file",
    "figure_file",
    "run_studies",
]

STUDIES: dict[str, Study] = {
    study.name: study
    for study in (
        ShrinkingRegion(),
        SwitchingGain(),
        SamplingTime(),
        GradientErrors(),
        Pareto(),
        NonStatic(),
        Robustness(),
        UnselectedExperiments(),
    )
}
"""Studies by the name files and the command line use."""
