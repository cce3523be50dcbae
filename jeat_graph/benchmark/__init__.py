"""What `jeat-graph benchmark` measures: one module a table of docs/benchmarks, and their inputs."""
