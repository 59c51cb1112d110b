"""Vision: camera and lens, calibration, markers, visual features and their task, images."""
