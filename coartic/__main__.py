"""``coartic`` and ``python -m coartic``: the command line."""

from coartic.internal.interruption import catch_signals, end_if_interrupted


def main() -> None:
    """Run a command, which may be interrupted from now on."""
    catch_signals()
    try:
        from coartic.cli import main as run_command

        run_command()
    finally:  # whatever libraries have made of the interruption
        end_if_interrupted()


if __name__ == "__main__":
    main()
