"""Smoothing inside the tracker: what each track took in, its smoother, and the smoothed table."""
