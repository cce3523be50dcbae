"""Cameras that are on now: what they give as it comes, by connections that are mended when they break."""
