"""Pictures of the scene: its radiance, the RGB camera and the event camera."""
