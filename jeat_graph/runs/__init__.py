"""Run directories: tracking a recording into one, and reading what it recorded."""
