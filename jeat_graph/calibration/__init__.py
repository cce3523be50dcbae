"""Calibration: what a configuration says of sensors and motion, estimated from recordings."""
