"""A service that tracks for months, as one file describes it, and can be watched from outside."""
