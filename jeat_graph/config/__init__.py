"""Configuration: its schema, how it is read, and the flat form in which compiled code takes it."""
