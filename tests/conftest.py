"""Settings that all tests share."""

from hypothesis import HealthCheck, settings

# the same examples on every run and machine: a failure is repeatable, and slowness is none
settings.register_profile(
    "repeatable",
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("repeatable")
