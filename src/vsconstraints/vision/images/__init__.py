"""Images of a board of AprilTags: printed, rendered, detected, and where markers and camera then
are (extra images).
"""
