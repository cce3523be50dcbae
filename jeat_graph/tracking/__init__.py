"""The online tracker: scans in, tracks out, one compiled step a batch; smoothing behind it."""
