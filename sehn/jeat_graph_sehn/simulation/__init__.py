"""The synthetic event + RGB highway: scene, camera, traffic, sensors."""
