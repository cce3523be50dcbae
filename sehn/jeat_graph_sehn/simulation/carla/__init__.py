"""Experimental recorder of segments in CARLA, tested with its client and a fake, never on a server."""
