"""Benchmarks: the tables of accuracy, ablation and speed that the README shows."""
