"""Tracks drawn over video, frames, events, or a plain background."""
