"""Where what the compiled step needs stands in its two arrays (see :mod:`vsconstraints.kernels.packing`), and kinds."""

# entries of the integer array
JOINTS, MARKERS, POINTS, ROWS, SIZE, FEATURE, INTERACTION, DRIFT_DIFFERENCES, VELOCITY_DIFFERENCES = range(9)
FIXED_CAMERA, MOVING_TARGET, TOLD_OF_TARGET, GOALS, BLOCKS = range(9, 14)
AT_CHAIN, AT_CAMERA, AT_MARKERS, AT_POINTS, AT_TARGET = range(14, 19)
AT_GOALS, AT_GAINS, AT_PRISMATIC, AT_BODIES, AT_BLOCKS = range(19, 24)
# what is computed after the step, by modules of their own: how many blocks, and where
REGIONS, AT_REGIONS, MEASURES, AT_MEASURES = range(24, 28)
HEADER = 28
# entries of a block of rows
KIND, FIRST, COUNT, PARAMETERS, MOTION, TOLD, WHICH, K_AT = range(8)
BLOCK = 8
# kinds of blocks
FIELD_OF_VIEW, CIRCLE, HYPERELLIPSE, BOWL, HEART, SPHERE, JOINTS_LINEAR, SPEEDS_LINEAR = range(8)
CAMERA_POSE, IMAGE_POINTS = range(2)
CURRENT, DESIRED, MEAN = range(3)
# kinds of regions
HALF_SPACE, BOX, CYLINDER, CAPSULE = range(4)
# laws of eq. (15); the last two are the blends of the potential field
TRACKING, SLIDING, PRIORITY, ADDITIVE = range(4)
# answers of the hierarchy: demands are unmet; levels 2 and 3 may be better met; both
RELAXED_ROWS, SHORT, RELAXED_SHORT = range(4, 7)
# scratch: so many 3 × 3 matrices and vectors of three
MATRICES, VECTORS = 11, 15
