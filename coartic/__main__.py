"""``coartic`` and ``python -m coartic``: the command line."""

import gc
import sys

from coartic.internal.interruption import catch_signals, end_if_interrupted


def main() -> None:
    """Run the command that the command line names.

    Exit with code 130 after Ctrl-C, and with code 143 after SIGTERM or SIGHUP.
    """
    catch_signals()
    gc.set_threshold(100_000, 50, 1_000)  # imported modules stay: collect garbage rarely
    try:
        from coartic.cli import main as run_command

        run_command()
    except ModuleNotFoundError as error:
        if error.name not in ("coartic.analysis", "coartic.baselines", "coartic.benchmarks"):
            raise
        sys.exit(
            f"Error: {error.name} is missing: this checkout has no symbolic links. Install the "
            "wheel, or `git config core.symlinks true` and `git checkout -- coartic`."
        )
    finally:  # whatever libraries have made of the interruption
        end_if_interrupted()


if __name__ == "__main__":
    main()
