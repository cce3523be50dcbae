"""The command line as `python -m jeat_graph`."""

from jeat_graph.cli.main import main

if __name__ == "__main__":
    raise SystemExit(main())
