"""The command line as `python -m jeat_graph`."""

from jeat_graph.cli import leave_current_folder

if __name__ == "__main__":
    leave_current_folder()
    from jeat_graph.cli.ending import end_with
    from jeat_graph.cli.main import main

    end_with(main)
