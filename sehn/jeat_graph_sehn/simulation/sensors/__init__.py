"""Simulated detectors: what each sensor finds of the world, with noise, misses and false boxes."""
