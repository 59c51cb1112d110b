"""Tolerances for rounding: when rows are met, violated, or linearly dependent.

All methods of computing a command share them.
"""

#: No acceleration can influence a row with ‖L_gφ‖ below this times its scale.
ZERO_GRADIENT = 1e-12
#: A demand exceeded by less than this fraction of its terms is met: that is rounding of A q̈ − c.
MET = 1e-12
#: A least violation below this fraction of the row's terms is rounding: the rows are compatible.
SIGNIFICANT = 1e-9
#: Fraction of their terms by which rows are relaxed if the hard rows are incompatible.
RELAXED = 1e-10
#: Threshold for dependence of rows of unit norm, used when violated rows are eliminated.
DEPENDENT = 1e-9
#: A row is active if its multiplier exceeds this fraction of the largest one.
PULLING = 1e-6
#: A row is not met if it is exceeded by more than the sum of MISSED times its terms and NEGLIGIBLE
#: in x: the distance to the minimiser without rows is then too large for rounding.
MISSED = 1e-6
NEGLIGIBLE = 1e-9
#: Level 2 is solved alone if the damped residual exceeds this fraction of ‖J‖ times the distance
#: from J†b.
STRICT = 1e-6
#: Relative gain of J below which a task is nearly singular: level 2 then uses only directions
#: above √damping.
WELL_CONDITIONED = 1e-3
