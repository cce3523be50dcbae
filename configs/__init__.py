"""Presets, as YAML files, and the recording that `demo` tracks."""
