"""The command line: ``palpate --help``."""

from palpate.cli.app import main

__all__ = ["main"]
