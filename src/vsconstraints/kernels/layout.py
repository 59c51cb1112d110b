"""Where what the compiled step needs stands in its two arrays; see :mod:`vsconstraints.kernels.packing`."""

# entries of the integer array
JOINTS, MARKERS, POINTS, ROWS, SIZE, FEATURE, INTERACTION, DRIFT_DIFFERENCES, VELOCITY_DIFFERENCES = range(9)
FIXED_CAMERA, MOVING_TARGET, GOALS, BLOCKS = range(9, 13)
AT_CHAIN, AT_CAMERA, AT_MARKERS, AT_POINTS, AT_TARGET = range(13, 18)
AT_GOALS, AT_GAINS, AT_PRISMATIC, AT_LINKS, AT_BLOCKS = range(18, 23)
# what is computed after the step, by modules of their own: how many blocks, and where
REGIONS, AT_REGIONS, MEASURES, AT_MEASURES = range(23, 27)
HEADER = 27
# entries of a block of rows
KIND, FIRST, COUNT, PARAMETERS, MOTION, WHICH, K_AT = range(7)
BLOCK = 7
# kinds of blocks
FIELD_OF_VIEW, CIRCLE, HYPERELLIPSE, BOWL, HEART, JOINTS_LINEAR, SPEEDS_LINEAR, SPHERE = range(8)
CAMERA_POSE, IMAGE_POINTS = range(2)
CURRENT, DESIRED, MEAN = range(3)
# kinds of regions
HALF_SPACE, BOX, CYLINDER, CAPSULE = range(4)
