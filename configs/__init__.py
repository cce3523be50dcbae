"""Presets and scenarios, as YAML files."""
