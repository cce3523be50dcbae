"""Near misses between vehicles on the road: surrogate measures of safety with intervals."""
