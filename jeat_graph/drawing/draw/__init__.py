"""A page in the browser in which lines, zones, masks and lengths are drawn over a picture."""
