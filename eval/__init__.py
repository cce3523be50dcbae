"""Evaluation: tracking metrics, motion errors, baselines, benchmarks."""
