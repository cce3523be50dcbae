"""Event cameras that are on: one module each."""
