"""Tracks and truth in the formats of other programs."""
