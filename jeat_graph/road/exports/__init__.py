"""Vehicles on the road for other programs: SUMO, users of highD, maps."""
