"""Version of the package: that of the jeat-graph it belongs to."""

__version__ = "0.1.0"
