"""The data that flows through the package: detections, trajectories, events, and a user's errors."""
