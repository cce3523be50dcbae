"""Layouts of networks' outputs: a file for each family, which `registry` finds; `record` says what one is."""
