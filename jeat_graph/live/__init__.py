"""The tracker in daily service: late scans, checkpoints, failing sensors, brokers, many recordings."""
