"""How long a control step takes, beside other ways to compute one: ``python -m benchmarks`` (see
``__main__``).
"""
