"""Several cameras along one road: the same vehicle at each, travel times, origin and destination."""
