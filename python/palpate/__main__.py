"""``python -m palpate`` is the command line."""

from palpate.cli import main

if __name__ == "__main__":
    main()
