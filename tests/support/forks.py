"""What is done in a process of its own that has imported already what takes longest."""

import multiprocessing
import sys
import warnings


def apart(what, *arguments):
    """What a function of a module returns, in a fork of this process (a fresh one where there are
    none). Raises ChildProcessError where it fails, after its traceback."""
    how = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
    received, answers = how.Pipe(duplex=False)
    process = how.Process(target=_say, args=(answers, what, arguments))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of threads, which a fork does not have
        process.start()
    answers.close()
    try:
        return received.recv()
    except EOFError:
        raise ChildProcessError("it ended without an answer") from None
    finally:
        process.join()


def _say(answers, what, arguments):
    answers.send(what(*arguments))


def forget(*packages):
    """Have these imported anew."""
    for name in [name for name in sys.modules if name.partition(".")[0] in packages]:
        del sys.modules[name]
