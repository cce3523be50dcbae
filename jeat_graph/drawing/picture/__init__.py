"""Draws a still picture of a whole run with matplotlib: the tracks in the image, and a timeline."""
