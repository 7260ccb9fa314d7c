"""``python -m coartic``: the command line."""

from coartic.cli import main

main()
