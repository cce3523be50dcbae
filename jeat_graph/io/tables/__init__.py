"""Tables of boxes, tracks and truth: one file a format."""
