"""Smoothers of one track, its last seconds or all of it; joining fragments, exchanging mixed-up tracks."""
