"""Sets of rendered recordings: how segments are drawn and split, their files, and the check of a set."""
