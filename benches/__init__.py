"""Measurements beside other methods and programs: ``python -m benches NAME`` in a checkout; not part of the package."""
