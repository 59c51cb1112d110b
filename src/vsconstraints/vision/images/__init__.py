"""Images of a board of AprilTags: printed, rendered, detected, and what a detection says of markers and camera.

Nothing here knows a robot or a controller; :mod:`vsconstraints.simulation.image_sensor` closes the loop. It needs the
extra ``images``.
"""
