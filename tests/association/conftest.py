"""The first call of a compiled function compiles it, which no deadline of a test should include."""

from hypothesis import settings

settings.register_profile("compiled", deadline=None)
settings.load_profile("compiled")
