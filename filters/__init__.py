"""Filters: the motion model, the adaptive Kalman filter of all tracks at once, its noise, the size filter."""
