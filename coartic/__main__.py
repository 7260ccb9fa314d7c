"""``coartic`` and ``python -m coartic``: the command line."""

from coartic.interruption import Interrupted, catch_signals, end_interrupted, ignore_signals


def main() -> None:
    """Run a command, which may be interrupted from now on."""
    try:
        catch_signals()
        from coartic.cli import main as run_command

        run_command()
    except Interrupted as interrupted:
        end_interrupted(interrupted)
    finally:
        ignore_signals()


if __name__ == "__main__":
    main()
