"""Simulated data sets in the folders that other people's programs for detection read."""
