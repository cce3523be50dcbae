"""Recorder of segments in CARLA. It was tested against the client package and a fake, never a server."""
