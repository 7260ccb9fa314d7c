"""Bad inputs: every one is answered by a sentence and changes nothing."""

from .attacks.inputs import CASES, ROOT, attack


def test_every_bad_input_is_answered():
    outcomes = attack(ROOT)
    assert [outcome.id for outcome in outcomes] == [case.id for case in CASES]
    assert len(outcomes) >= 400
    assert {o.id: (o.problems, o.answer) for o in outcomes if o.problems} == {}


def test_a_bad_answer_is_noticed(tmp_path):
    """A checkout whose command line leaves files, says nothing, breaks, hangs."""
    package = tmp_path / "coartic"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "cli.py").write_text(
        "import signal, sys, os\n"
        "def main():\n"
        "    match sys.argv[1]:\n"
        "        case 'fly': open('left', 'w')\n"
        "        case 'RUN': raise ValueError('x')\n"
        "        case '': os.kill(os.getpid(), signal.SIGALRM)\n"
        "        case '--nope': sys.exit('')\n"
        "        case _: print('error: \\x1b[2J'); sys.exit(2)\n"
    )
    commands = ("unknown command", "command in capitals", "empty command", "unknown option")
    chosen = [*(f"command: {name}" for name in commands), "command: command in markup"]
    found = {outcome.id: "; ".join(outcome.problems) for outcome in attack(tmp_path, chosen)}
    for name, words in zip(
        chosen,
        ("exit code 0, not 2; no sentence; an answer without \"No such command 'fly'\"; "
         "here, here/left changed",
         "a traceback: ValueError: x", "no answer within", "no sentence",
         "control characters: '\\x1b'"),
        strict=False,
    ):  # fmt: skip
        assert words in found[name], (name, found)
