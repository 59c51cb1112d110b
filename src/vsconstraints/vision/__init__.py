"""What a camera sees: camera and lens, calibration, the scene of markers, features and the task
they make, images.
"""
