"""Scans and tracks as lines of a stream."""
