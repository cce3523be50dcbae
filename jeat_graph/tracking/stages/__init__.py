"""The stages of one step of the tracker, compiled, in the order in which `step` calls them."""
