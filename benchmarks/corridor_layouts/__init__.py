"""Layouts of published recordings of several cameras, one record a file, for `benchmarks handover`."""
