"""Smoothers of single tracks."""
