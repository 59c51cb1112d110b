"""What counts as rounding where rows are met, exceeded, or depend on each other: for every way to
compute a command.
"""

#: A row with ‖L_gφ‖ below this times its scale is one that no acceleration can influence.
ZERO_GRADIENT = 1e-12
#: A demand exceeded by less than this fraction of its terms is met: it is the rounding of A q̈ − c.
MET = 1e-12
#: A least violation below this fraction of the row's terms is rounding: the rows are compatible.
SIGNIFICANT = 1e-9
#: Fraction of their terms by which rows are relaxed once the hard ones have been found
#: incompatible.
RELAXED = 1e-10
#: Rows of unit norm count as dependent below this fraction, when violated rows are eliminated.
DEPENDENT = 1e-9
#: A row holds the solution if its multiplier exceeds this fraction of the largest one.
PULLING = 1e-6
#: A row exceeded by more than the first as a fraction of its terms, and by more than the second in
#: x, is not met: the minimiser without rows is too far away for rounding.
MISSED = 1e-6
NEGLIGIBLE = 1e-9
#: Level 2 is found by itself if the damped residual exceeds this fraction of ‖J‖ times the way from
#: J†b.
STRICT = 1e-6
#: Relative gain of J below which a task is nearly singular: √damping then limits what level 2 may
#: ask for.
WELL_CONDITIONED = 1e-3
