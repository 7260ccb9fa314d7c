"""``coartic`` and ``python -m coartic``: the command line."""

from coartic.interruption import catch_signals, wait_if_ending


def main() -> None:
    """Run a command, which may be interrupted from now on."""
    catch_signals()
    try:
        from coartic.cli import main as run_command

        run_command()
    finally:
        wait_if_ending()


if __name__ == "__main__":
    main()
