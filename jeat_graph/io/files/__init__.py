"""Files as such: whole or not there, locked, packed, bounded, and what may be overwritten."""
