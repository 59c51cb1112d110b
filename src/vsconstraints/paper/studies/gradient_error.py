"""Study of every law with errors of the gradient."""

from __future__ import annotations

from typing import NamedTuple

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import number, percent
from ...reports.plots import Sheet, widths
from .drawing import Measure, add_panels, draw_crosses, draw_line, law_style
from .laws import LAWS
from .study import Found, Results, Study, StudyResult
from .summary import NOT_RUN, RunSummary, pixel_distance
from .tables import Numbers, Point, Points, ended_early, greatest, grouped, sentence_start, where

PRINTED = 0.3  #: Error c_e of the paper.


class ErrorCase(NamedTuple):
    """Scenario, law, and error c_e of the gradient (49)."""

    scenario: str
    controller: str
    gradient_error: float


#: Errors by scenario.
ERRORS = {
    "example-2d-fov": (0.0, 0.1, 0.3, 0.6, 1.0),
    "case-study-6r": (0.0, 0.3, 1.0),
    "experiment-1-pbvs": (0.0, 0.3, 0.6, 1.0),
    "experiment-2-ibvs": (0.0, 0.3, 0.6, 1.0),
}
SMALL_ERRORS = {"example-2d-fov": (0.0, 0.3)}

MEASURES = {
    "deviation_px": Measure(
        label="deviation of a\nmarker [px]",
        linear_below=1.0,
        low=0.0,
        headroom=10.0,  # room for crosses
        top=10.0,
    ),
    "violation": Measure(
        label="depth of violation\n[% of L]", linear_below=0.01, low=-0.002, top=1.0
    ),
    "settling_time_s": Measure(label="settling time [s]", linear=True),
}
#: Horizontal shift of the crosses of laws, so that they do not cover each other.
SHIFT = {
    "sliding-mode": -0.07,
    "potential-field": -0.035,
    "hierarchical-qp": 0.035,
    "hierarchical-qp-active": 0.07,
}


class GradientError(Study):
    """All laws with the erroneous gradient (49) in their visibility rows.

    The deviation is the greatest distance, at any time, of a marker from its position in the run of
    the same law with exact gradients.
    """

    name = "gradient-error"
    title = "Erroneous gradients"
    question = "How much does an error of the gradients change, for every controller?"
    claims = (6, 9)
    columns = (
        "status",
        "reason",
        "deviation_px",
        "violation",
        "violated",
        "settling_time_s",
        "utilization",
        "phi_max",
        "longest_run",
    )
    figure_caption = (
        "Every controller with the gradient error c_e of (49). Top: greatest distance of a marker "
        "from the same controller's run with exact gradients. A cross marks a run that failed or "
        "was aborted."
    )

    def runs(self, *, small: bool = False) -> dict[ErrorCase, RunSpec]:
        """Return runs by case, in order of the figure's data; if ``small``, a few short ones."""
        shorter = {"duration": 6.0} if small else {}
        runs = {}
        for scenario, errors in (SMALL_ERRORS if small else ERRORS).items():
            for name, law in LAWS.items():
                for error in errors:
                    disturbances = {"disturbances": {"gradient_error": error}} if error else {}
                    spec = RunSpec(scenario, law, {**disturbances, **shorter})
                    runs[ErrorCase(scenario, name, error)] = spec
        return runs

    def lines(self, case: ErrorCase, run: RunSummary, results: Results) -> Points:
        """Deviation from the run with exact gradients."""
        exact = results.get(case._replace(gradient_error=0.0), NOT_RUN)
        return [{"deviation_px": pixel_distance(run, exact)}]

    def numbers(self, points: Points) -> Found:
        """Deviation, violation, settling time and outcome of every run."""
        names = ("deviation_px", "violation", "settling_time_s")
        return {
            (point["scenario"], point["controller"], point["gradient_error"]): {
                **{name: point[name] for name in names},
                "converged": point["status"] == "converged",
            }
            for point in points
        }

    def sentences(self, points: Points, numbers: Numbers) -> list[str]:
        """Return the sentences of the result."""
        sentences = []
        for scenario, of_scenario in grouped(points, "scenario").items():
            texts = [
                f"{point['controller']} {described(point)}"
                for point in where(of_scenario, gradient_error=PRINTED)
            ]
            sentences.append(f"{sentence_start(scenario)}, c_e = {PRINTED}: {'; '.join(texts)}.")
            most = greatest(of_scenario, "gradient_error")
            arrived = where(of_scenario, gradient_error=most, status="converged")
            laws = ", ".join(point["controller"] for point in arrived) or "no controller"
            sentences.append(f"With c_e = {most:g} the goal is reached by {laws}.")
        return sentences

    def figure(self, result: StudyResult) -> Sheet:
        """Draw each measure over the error, one line for each law."""
        points = list(result.points)
        laws = list(grouped(points, "controller"))
        width = widths(laws, 1.8, 1.0)
        styles = {law: law_style(law, linewidth=width[law]) for law in laws}
        for style in styles.values():
            style |= {"markersize": 4.5, "alpha": 0.9}
        sheet = Sheet(left=0.9)
        sheet.legend(list(styles.values()))
        below = "gradient error cₑ"
        for panel in add_panels(sheet, points, MEASURES, below, height=1.4, gap=0.6):
            for law, runs in grouped(panel.points, "controller").items():
                draw_line(panel.ax, runs, "gradient_error", panel.measure, styles[law])
                if panel.measure == "deviation_px":
                    shift = SHIFT.get(law, 0.0)
                    draw_crosses(panel.ax, runs, "gradient_error", styles[law], shift)
            if panel.measure == "settling_time_s":
                panel.ax.margins(y=0.17)
            MEASURES[panel.measure].finish(panel.ax)
            panel.ax.set_xlim(-0.06, 1.14)
        return sheet


def described(point: Point) -> str:
    """Words for the effect of an error on a law."""
    if ended_early(point):
        return f"{point['status']} ({point['reason']})"
    violation = "nothing"
    if point["violation"] > 0:
        violation = f"{point['violated']} by {percent(point['violation'] / 100)} % of L"
    return f"deviates {number(point['deviation_px'])} px and violates {violation}"
