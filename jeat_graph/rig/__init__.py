"""Rigs: several sensors, each with a picture and a clock of its own, that look at one road."""
