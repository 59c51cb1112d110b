"""Integers that compiled functions and Python exchange: codes, options, and places in arrays."""

from __future__ import annotations

#: Codes of compiled functions: solved; the NumPy version has to answer; no answer passes the check;
#: rows contradict each other; active rows have lost full row rank. Codes of the hierarchy: bounds
#: are violated; levels 2 and 3 may be improved; both.
SOLVED, NEEDS_PYTHON, FAILED, INCOMPATIBLE, RANK_LOSS, RELAXED_ROWS, SHORT, RELAXED_SHORT = range(8)
CAMERA_POSE, IMAGE_POINTS, OWN = range(3)  #: Features of the task.
#: Objectives below the rows: the task, then the least acceleration; the distance to the
#: unconstrained command, in joint space, or in task space with a small part in joint space; the
#: distance to a share of that command.
STRICT, NEAREST, WEIGHED, SCALED = range(4)
#: Options of a resolver: rank tolerance; of a hierarchy also greatest |q̈|, damping and objective;
#: of a saturation also 1 if it scales the task.
TOLERANCE, LIMIT, DAMPING, OBJECTIVE, SCALES = range(5)
STAGE = 1  #: Option of a law that looks ahead, whose only other option is the rank tolerance.
#: Gains of a predicted task: K_p(0), its slope and K_v/√K_p; d and (d/2)² of q̈₀.
KP0, KP_SLOPE, KV_FACTOR, REST_DAMPING, REST_STIFFNESS = range(5)
FEWEST_INSTANTS = 2  #: Number of predicted instants from which on there is a program of a plan.
#: Parts of a prediction: φ, σ, L_gφ, J, b, e and q̈₀. Their names in Python, in the same order.
PHI, SIGMA, GRADIENT, JACOBIAN, B, ERROR, REST, PARTS = range(8)
QUANTITIES = ("phi", "sigma", "Lg", "J", "b", "error", "rest")
#: Entries of the innovation of a step: those of ``INNOVATIONS`` in
#: :mod:`vsconstraints.vision.measurement`, then the greatest ratio of one of them to its bound.
IMAGE, SHAPE, POSITION, ORIENTATION, AGE, SPEED, DEPTH, WORST = range(8)
