"""The simulated world: road, vehicles, traffic, light and camera, at any time."""
