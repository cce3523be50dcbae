"""The data that flows through the package: detections, trajectories, events, and errors that users can meet."""
