"""Tables of detections, truth and results, from files with columns or data frames."""
