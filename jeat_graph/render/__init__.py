"""Tracks drawn over video, frames or events."""
