"""Formulas of the documentation are those of the code: read from the pages, or traced to the test
that checks them.
"""

from __future__ import annotations

import ast
import html
import inspect
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from documents import DOCS, blocks
from vsconstraints import Camera
from vsconstraints.constraints import FieldOfView, JointRange, JointSpeed, Manipulability
from vsconstraints.controllers import make_controller
from vsconstraints.dynamics.kernels.drives import dry_friction
from vsconstraints.formulas.tracking import funnel
from vsconstraints.robots import ready_made
from vsconstraints.vision.motion import Motion
from vsconstraints.vision.tracking import Rest, TrackingGains

TESTS = Path(__file__).parent


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def python_of(formula: str) -> str:
    """Return a formula as it is printed in a line of text, in Python."""
    text = re.sub(r"\|([^|]+)\|", r"abs(\1)", formula)
    for printed, meant in {
        "−": "-",
        "²": "**2",
        "ⁿ": "**n",
        "₀": "0",
        "∞": "_end",
        "2πft": "2*pi*f*t",
        "∘": "*",
    }.items():
        text = text.replace(printed, meant)
    text = re.sub(r"\b(sin|sign) (\S+?)(?=\)|$)", r"\1(\2)", text)
    # what stands side by side is multiplied; a name before a bracket without a space is a function
    return re.sub(r"(?<=[\w)\u0307\u0308]) +(?=[\w(])", "*", text)


def value(file: str, begin: str, end: str, **symbols: Any) -> Any:
    """Evaluate the formula that stands in a page between two texts."""
    (printed,) = re.findall(re.escape(begin) + r"(.*?)" + re.escape(end), page(file))
    functions = {
        "abs": np.abs,
        "sin": np.sin,
        "exp": np.exp,
        "sign": np.sign,
        "pi": math.pi,
        "min": min,
    }
    return eval(python_of(printed), functions | symbols)


def camera() -> Camera:
    return Camera((600.0, 500.0), (640.0, 480.0))


def test_the_field_of_view_has_the_documented_half_axes() -> None:
    arguments = {"K": 0.1, "switching_gain": 1.0}
    by_share = FieldOfView(camera(), margin=0.05, **arguments).half_size
    by_pixels = FieldOfView(camera(), margin_px=17.0, **arguments).half_size
    for k, W in enumerate((640.0, 480.0)):
        assert by_share[k] == pytest.approx(
            value("scenarios.md", "fraction of the image: a = ", "\n", W=W, margin=0.05)
        )
        assert by_pixels[k] == pytest.approx(
            value("scenarios.md", "in pixels: a = ", "\n", W=W, margin_px=17.0)
        )


def test_the_field_of_view_is_the_documented_hyperellipse() -> None:
    fov = FieldOfView(camera(), margin=0.05, n=4.0, K=0.1, switching_gain=1.0)
    for u, v in np.random.default_rng(0).uniform(-300.0, 300.0, (20, 2)):
        a, b = fov.half_size
        said = value("scenarios.md", "Rows `fov[marker i]`: σ = ", ".\n", u=u, v=v, a=a, b=b, n=4.0)
        assert fov.sigma(np.array([u, v])) == pytest.approx(said)


def test_joint_ranges_are_the_documented_rows() -> None:
    robot = ready_made("ur5")
    limits = {2: (-1.0, 2.0), 4: (-2.0, 2.5)}
    rows = JointRange(
        robot,
        joints=[2, 4],
        lower=[-1.0, -2.0],
        upper=[2.0, 2.5],
        margin=0.1,
        K=0.1,
        switching_gain=1.0,
    )
    q = np.random.default_rng(1).uniform(-3.0, 3.0, robot.n)
    printed = page("scenarios.md").partition(".upper` and `.lower`, σ = ")[2].partition("; rows")[0]
    said = []
    for side in "+-":
        for joint, (lower, upper) in limits.items():
            symbols = {
                "q": q[joint - 1],
                "mid": 0.5 * (lower + upper),
                "half": 0.5 * (upper - lower),
                "margin": 0.1,
            }
            said.append(eval(python_of(printed.replace("±", side)), symbols))
    assert rows.sigma(q) == pytest.approx(said)


def test_joint_speeds_are_the_documented_rows() -> None:
    robot = ready_made("ur5")
    rows = JointSpeed(
        robot, joints=[2, 4], lower=[-1.0, -2.0], upper=[2.0, 2.5], margin=0.1, switching_gain=1.0
    )
    qd = np.random.default_rng(2).uniform(-3.0, 3.0, robot.n)
    said = []
    for joint, limit in ((2, 2.0), (4, 2.5), (2, -1.0), (4, -2.0)):
        symbols = {"q̇": qd[joint - 1], "limit": limit, "margin": 0.1}
        said.append(value("scenarios.md", "\nφ = ", " with the upper", **symbols))
    assert rows.phi(qd) == pytest.approx(said)
    symmetric = JointSpeed(robot, upper=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], switching_gain=1.0)
    assert symmetric.lower.tolist() == (-symmetric.upper).tolist()


def test_motion_is_the_documented_one() -> None:
    motion = Motion([1.0, 2.0], amplitude=[3.0, 4.0], frequency=0.7, phase=0.3)
    for t in (0.0, 0.4, 2.0):
        symbols = {"v": np.array([1.0, 2.0]), "A": np.array([3.0, 4.0]), "f": 0.7, "ψ": 0.3, "t": t}
        assert motion.displacement(t) == pytest.approx(
            value("scenarios.md", "\nd(t) = ", ":", **symbols)
        )


def test_free_joints_move_as_documented() -> None:
    d = 3.0
    qd = 0.7
    q = 0.2
    q_posture = 1.1
    rest = Rest(damping=d, posture=[q_posture])
    said = value("scenarios.md", "q̈₀ = ", ".\n", d=d, q=q, q_posture=q_posture, q̇=qd)
    assert -rest.damping * qd + rest.stiffness * (q_posture - q) == pytest.approx(said)


def test_friction_is_the_documented_one() -> None:
    class Drive:
        static = np.array([3.0])
        coulomb = np.array([2.0])
        stribeck = np.array([0.05])

    for speed in (-0.3, -0.02, 0.01, 0.5):
        symbols = {"f_v": 0.0, "f_c": 2.0, "f_s": 3.0, "v_s": 0.05, "q̇": speed}
        said = value("scenarios.md", "τ_f = ", "; static", **symbols)
        plain = getattr(dry_friction, "py_func", dry_friction)
        assert math.copysign(plain(Drive, 0, speed), speed) == pytest.approx(said)


def test_manipulability_is_the_documented_one() -> None:
    robot = ready_made("ur5")
    row = Manipulability(robot, minimum=0.02, scale=0.05, K=0.1, switching_gain=1.0)
    q = np.array([0.3, -1.2, 1.4, 0.2, 1.1, 0.4])
    J = robot.evaluator()(q, np.zeros(6)).J
    w = math.sqrt(np.linalg.det(J @ J.T))
    said = value(
        "scenarios.md", "manipulability[part]`: σ = ", " with", minimum=0.02, w=w, scale=0.05
    )
    trace = type("Trace", (), {"q": q[None]})
    assert -row.clearance(trace, slice(0))[0, 0] == pytest.approx(said)  # type: ignore[arg-type]


def test_gains_decrease_as_documented() -> None:
    """K_p = K_p(0) exp(−K̇_p(0) ‖e‖ / K_p(0)), and K_v = 3 √K_p by default: what theory.md
    prints.
    """
    text = " ".join(page("theory.md").split())
    assert (
        r"K_{T,p} = K_{T,p}(0)\,\exp\!\left(-\frac{\dot K_{T,p}(0)}{K_{T,p}(0)}\,\lVert e\rVert_2\right)"
        in text
    )
    assert r"K_{T,v} = 3\sqrt{K_{T,p}}" in text
    Kp, Kv = TrackingGains(Kp0=30.0, Kp_slope=5.0).at(np.array([0.3, 0.4]))
    assert Kp == pytest.approx(30.0 * math.exp(-5.0 / 30.0 * 0.5))
    assert Kv == pytest.approx(3.0 * math.sqrt(Kp))


def test_settings_of_laws_are_the_documented_ones() -> None:
    text = page("laws.md")
    robust = inspect.signature(type(make_controller("robust-predictive"))).parameters
    assert (
        f"adds `margin = {robust['margin'].default:g}` and `observer = "
        f"{robust['observer'].default:g}`" in text
    )


def test_the_variable_does_to_the_compiler_what_is_said() -> None:
    """With VSCONSTRAINTS_COMPILE=0 the functions that would be compiled run as they are, and
    nothing warns.
    """
    said = " ".join(page("trust.md").split())
    assert (
        "the same functions run uncompiled; `VSCONSTRAINTS_COMPILE=0` asks for that, without a "
        "warning" in said
    )
    code = (
        "from vsconstraints.compiled import available\n"
        "from vsconstraints.scenarios import Scenario\n"
        "step = Scenario.load('example-2d-fov').setup().control()\n"
        "print(available(), type(step).__name__)"
    )
    environment = {**os.environ, "VSCONSTRAINTS_COMPILE": "0"}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True,
        text=True,
        env=environment,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["False", "ControlStep"]


#: The test that checks each numbered formula of the pages on theory and laws: in a page's own
#: block, or in a module.
CHECKED = {
    "modified": "theory.md",
    "lie": "theory.md",
    "chain": "test_derivatives::test_features",
    "funnel": "test_documented_formulas::test_funnels_are_the_documented_ones",
    "feature": "test_derivatives::test_features",
    "task": "test_tracking::test_the_task_makes_the_error_obey_a_damped_oscillator",
    "interaction": "test_formulas::test_rows_of_the_interaction_matrix_are_the_textbooks",
    "rest": "test_rest::test_a_posture_is_approached_with_critical_damping",
    "slide": "test_controllers::test_the_sliding_mode_is_equation_15",
    "gain": "theory.md",
    "priority": "test_controllers::test_the_sliding_mode_is_equation_15",
    "psi": "test_controllers::test_the_priority_blend_demands_a_share_of_the_switching_gain",
    "stopping": "test_limits::test_the_greatest_acceleration_is_the_greatest",
    "share": "test_limits::test_what_holding_takes_is_what_a_linear_program_says",
    "band": "test_bands::test_bands_shrink_as_theory_says",
    "excess": "theory.md",
    "demand": "test_resolvers::test_a_formula_in_numpy_gives_the_same_command",
    "implicit-switch": "test_demands::test_the_implicit_switch_rests_at_the_drift_times_p_periods",
    "implicit-switch-with-drift": (
        "test_demands::test_a_drift_that_is_seen_is_held_in_a_band_of_the_square_of_the_period"
    ),
    "firas": "test_demands::test_firas_pushes_by_the_slope_of_its_potential",
    "super-twisting": (
        "test_demands::test_super_twisting_holds_a_changing_drift_in_a_band_of_the_square_of_the_period"
    ),
    "implicit-super-twisting": "test_demands::test_the_implicit_form_solves_its_inclusion",
    "velocity-form": "test_derivatives::test_constraints",
    "high-order-barrier": "test_demands::test_a_high_order_barrier_is_met_where_psi_decays",
    "prescribed-time-barrier": "test_demands::test_a_row_is_back_by_the_prescribed_time_from_any_start",
    "large-projection": "test_resolvers::test_the_operator_opens_as_visp_has_it",
    "predictive": "test_predictive::test_plans_are_those_of_a_dense_program_with_states_eliminated",
    "mppi": "test_path_integral::test_costs_are_those_of_the_formula",
    "governor": "test_goal_governor::test_commands_are_those_of_the_decision_in_numpy",
    "barrier-governor": "test_barrier_governor::test_moves_are_those_of_a_qp_and_h_stays_positive",
}


def test_every_numbered_formula_names_the_test_that_checks_it() -> None:
    labels = []
    for path in sorted(DOCS.glob("*.md")):
        labels += re.findall(r"^\$\$ \(([\w-]+)\)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(labels) == sorted(CHECKED)
    for label, where in CHECKED.items():
        module, _, test = where.partition("::")
        if test:
            tree = ast.parse((TESTS / f"{module}.py").read_text(encoding="utf-8"))
            assert test in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, (
                label
            )
        else:
            assert any(
                "assert" in block.code
                for block in blocks(DOCS / where)
                if block.language == "python"
            )


def test_funnels_are_the_documented_ones() -> None:
    """σ = ±e/ρ₀ − ρ(t)/ρ₀ with ρ(t) = (ρ₀ − ρ_∞) e^(−l t) + ρ_∞: both pages print the same."""
    assert r"\rho(t) = (\rho_0 - \rho_\infty)\,e^{-lt} + \rho_\infty" in page("theory.md")
    final = 0.1
    decay = 0.5
    for t in (0.0, 0.7, 3.0):
        share = funnel(t, final, decay)
        share = share[0] if isinstance(share, tuple) else share
        assert share == pytest.approx((1.0 - final) * math.exp(-decay * t) + final)


#: Dots and bars above a letter, which fonts of text have: browsers take them from the page's.
ACCENTS = {"¨", "˙", "¯"}


def test_the_font_of_formulas_is_shipped_and_has_every_sign() -> None:
    """It has the table by which browsers set MathML, and every sign of the pages' formulas."""
    fonttools = pytest.importorskip("fontTools.ttLib")  # comes with matplotlib
    style = page("_static/style.css")
    (name,) = re.findall(
        r'@font-face \{ font-family: "Noto Sans Math"; src: url\("([\w.-]+)"\)', style
    )
    assert 'math { font-family: "Noto Sans Math", math; }' in style
    font = fonttools.TTFont(DOCS / "_static" / name)
    assert "MATH" in font
    known = {chr(code) for code in font.getBestCmap()}
    convert = pytest.importorskip("latex2mathml.converter").convert
    for path in sorted(DOCS.glob("*.md")):
        text = re.sub(
            r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
        )
        for formula in re.findall(r"\$\$(.*?)\$\$|\$([^$\n]+)\$", text, re.DOTALL):
            drawn = html.unescape(re.sub(r"<[^>]+>", "", convert("".join(formula))))
            missing = {sign for sign in drawn if not sign.isspace()} - known - ACCENTS
            assert not missing, f"{path.name}: {formula}: {missing}"
