"""Runs, roads and sets for other programs: one module with one record each; `registry` finds them."""
