"""Functions that people call from Python: everything here is also in `jeat_graph` itself."""
