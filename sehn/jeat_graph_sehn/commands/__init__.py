"""Commands that `jeat-graph` finds here: `simulate` and `train`."""
