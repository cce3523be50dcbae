"""Association of detections with tracks: gates, costs, assignment, births, merging."""
