"""Temporary."""
from jeat_graph.tracking.model_tracker import ModelTracker as Tracker
__all__ = ["Tracker"]
