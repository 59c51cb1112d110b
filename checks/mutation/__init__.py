"""Check that tests notice wrong code: ``python -m checks.mutation`` (see ``__main__``)."""
