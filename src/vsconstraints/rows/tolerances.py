"""What counts as rounding where rows are met, exceeded, or depend on each other: for every way to compute a command."""

ZERO_GRADIENT = 1e-12  #: A row with ‖L_gφ‖ below this times its scale is one that no acceleration can influence.
MET = 1e-12  #: A demand exceeded by less than this fraction of its terms is met: it is the rounding of A q̈ − c.
SIGNIFICANT = 1e-9  #: A least violation below this fraction of the row's terms is rounding: the rows are compatible.
RELAXED = 1e-10  #: Fraction of their terms by which rows are relaxed once the hard ones have been found incompatible.
DEPENDENT = 1e-9  #: Rows of unit norm count as dependent below this fraction, when violated rows are eliminated.
PULLING = 1e-6  #: A row holds the solution if its multiplier exceeds this fraction of the largest one.
#: A row exceeded by more than the first as a fraction of its terms, and by more than the second in x, is not met: the
#: minimiser without rows is too far away for rounding.
MISSED, NEGLIGIBLE = 1e-6, 1e-9
STRICT = 1e-6  #: Level 2 is found by itself if the damped residual exceeds this fraction of ‖J‖ times the way from J†b.
#: Relative gain of J below which a task is nearly singular: √damping then limits what level 2 may ask for.
WELL_CONDITIONED = 1e-3
