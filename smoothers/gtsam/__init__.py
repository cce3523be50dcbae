"""Everything that calls GTSAM: factor graphs of one track, whole or over a sliding window."""
