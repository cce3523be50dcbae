"""Files of event cameras: one module a format, all read piece by piece by `opening.open_events`."""
