"""Metrics of tracking, one module with one record each; `eval.metrics` finds them."""
