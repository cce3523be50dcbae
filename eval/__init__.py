"""Judging tracks: scores against truth, errors of motion, true variances, counts, and other trackers."""
