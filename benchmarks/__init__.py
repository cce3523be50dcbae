"""What `python -m benchmarks` measures: one module a table of docs/benchmarks, their inputs, and peers."""
