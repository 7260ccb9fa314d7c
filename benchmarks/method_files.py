"""Import a method file in its own process, which answers questions about the methods in plain data.

Changes that a file makes to its process on import (another working folder, patches, limits, an
exit) do not affect the process that runs suites.
"""

from __future__ import annotations

import atexit
import errno
import itertools
import json
import multiprocessing
import os
from collections.abc import Callable, Collection, Iterator
from dataclasses import asdict
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import TypeAdapter

from coartic.benchmarks.own_code import code_of
from coartic.benchmarks.pool import CONTEXT, MORE_FILES, signal_name, start_process
from coartic.errors import CoarticError
from coartic.internal.text import LONGEST_LINE, error_line, plain
from coartic.internal.threads import begin_worker, end_group
from coartic.method import Information, Method
from coartic.runs.method_info import MethodInfo, answer, load_file, method_info, methods_in

_ANSWER_S = 300.0  # longest wait for an answer: libraries can take long to import
_LONGEST_ANSWER = 2**24  # bytes of an answer
_KINDS: dict[str, TypeAdapter[Any]] = {
    "methods": TypeAdapter(list[MethodInfo]),
    "complete": TypeAdapter(dict[str, Any]),
    "why_not": TypeAdapter(str | None),
    "rules": TypeAdapter(dict[str, dict[str, Any]]),
}
"""Kind of the answer, by question."""


def begin_reader(path: Path, shown: str) -> Callable[..., Any]:
    """Start a process for a method file, and return a function that asks the process about a
    method. ``shown`` is the name of the file in messages. The function takes the id of a method, a
    question of :func:`.answer` and its arguments; the question ``methods``, with an empty id, comes
    first: it imports the file, and gives the declarations of all methods. The function raises
    CoarticError for an error there, for an answer of another kind, and for no answer in 5 minutes.
    The process, with all processes of its group, ends with this process. Raises CoarticError if no
    process begins."""
    try:
        pipe, theirs = multiprocessing.Pipe()
        answers = theirs, path, shown
        process = CONTEXT.Process(target=_answer_questions, args=answers, daemon=True)
        start_process(process)
    except (OSError, EOFError) as error:  # EOFError: its server was killed
        why = getattr(error, "strerror", None) or error_line(error)
        how = f" {MORE_FILES}" * (getattr(error, "errno", 0) == errno.EMFILE)
        words = f"{shown} is not read: no process for it begins ({why})"
        raise CoarticError(f"{words}. Repeat the command{how}") from None
    atexit.register(end_group, process.pid)
    theirs.close()
    numbers = itertools.count()

    def ask(method: str, question: str, *arguments: Any) -> Any:
        number = next(numbers)
        try:
            pipe.send_bytes(json.dumps([number, method, question, *arguments]).encode())
            if not pipe.poll(_ANSWER_S):
                end_group(process.pid)
                raise CoarticError(f"{shown}: gives no answer within {_ANSWER_S:g} s")
            text = pipe.recv_bytes(_LONGEST_ANSWER)
        except (OSError, EOFError):
            process.join(1.0)
            code = process.exitcode
            if code is None or code < 0 or code == 255:  # 255: its server was killed
                name = signal_name(-code) if code and code < 0 else "a signal"
                raise CoarticError(
                    f"{shown} is not read: {name} ended the process that reads it, from outside or "
                    "by the file itself. Repeat the command"
                ) from None
            how = f"its process ended with exit code {code}"
            raise CoarticError(f"{shown}: cannot be imported: {how}") from None
        try:
            answered, kind, content = json.loads(text)
            if answered != number:
                raise ValueError(f"question {number} has the answer to question {answered}")
            if kind == "answer":
                return _KINDS[question].validate_python(content)
        except (ValueError, TypeError, RecursionError) as error:
            why = error_line(error)
            raise CoarticError(f"{shown}: its answers cannot be read: {why}") from None
        raise CoarticError(plain(str(content)))

    return ask


def _answer_questions(pipe: Any, path: Path, shown: str) -> None:
    """Answer questions on the file ``path``, ``shown`` in messages: through a pipe come JSON
    ``[NUMBER, METHOD, QUESTION, ARGUMENTS...]``, and go ``[NUMBER, "answer", ANSWER]`` or
    ``[NUMBER, "error", SENTENCE]``, until it is closed. A child that the file has forked ends
    instead of answering."""
    begin_worker()
    reader = os.getpid()
    methods: dict[str, type[Method]] = {}
    while True:
        try:
            number, name, question, *arguments = json.loads(pipe.recv_bytes())
        except EOFError:
            return
        try:
            content: Any
            if question == "methods":
                try:
                    module = load_file(path)
                except BaseException as error:
                    why = f"{shown}: cannot be imported: {error_line(error)}"
                    raise CoarticError(why) from None
                found = dict.fromkeys(methods_in(module))
                content = [asdict(info) for info in _methods_of_module(module, found, shown, path)]
                methods = {method.name: method for method in found}
            else:
                content = answer(methods[name], question, *arguments)
            text = json.dumps([number, "answer", content])
        except CoarticError as error:
            text = json.dumps([number, "error", str(error)])
        except BaseException as error:
            text = json.dumps([number, "error", f"{shown}: cannot be used: {error_line(error)}"])
        if os.getpid() != reader:
            os._exit(0)
        pipe.send_bytes(text.encode())


def _methods_of_module(
    module: ModuleType, methods: Collection[type[Method]], origin: str, file: Path
) -> Iterator[MethodInfo]:
    """Yield the declarations of ``methods``, the classes that ``module`` defines, with their code;
    ``origin`` is the name of the ``file`` in messages. Raises CoarticError for no method, for
    declared texts or information of a wrong form, and for a file that cannot be read."""
    for method in methods:
        where = f"{origin}: {method.__name__}"
        for attribute in ("name", "title", "citation", "tuned_on"):
            text = getattr(method, attribute, None)
            if not isinstance(text, str) or plain(text, LONGEST_LINE) != text:
                raise CoarticError(f"{where}: {attribute} must be a text of one line, not {text!r}")
        information = getattr(method, "information", None)
        if not isinstance(information, frozenset | set) or not all(
            isinstance(each, Information) for each in information
        ):
            wrong = f"{where}: information must be a set of Information, not {information!r}"
            raise CoarticError(wrong)
        try:
            code = code_of(method, file)
        except CoarticError as error:
            raise CoarticError(f"{origin}: {error}") from None
        except OSError as error:
            wrong = f"{error.filename}: cannot be read: {error.strerror}"
            raise CoarticError(f"{origin}: {wrong}") from None
        yield method_info(method, origin, str(file), code)
    if not methods:
        unfinished = [
            f"{method.__name__} has no {', '.join(sorted(method.__abstractmethods__))}"
            for method in methods_in(module, abstract=True)
        ]
        why = f" that is complete: {', '.join(unfinished)}" if unfinished else ""
        raise CoarticError(
            f"{origin}: defines no subclass of coartic.Method or coartic.Optimiser{why}"
        )
