"""Methods and tasks of the user's files, and the examples of the pages."""

import math
import os
import py_compile
import signal
from pathlib import Path

import numpy as np
import pytest

from coartic import CoarticError, MotionModel, load_task
from coartic.analysis.study import load
from coartic.benchmarks import scoring
from coartic.benchmarks.registry import registry
from tests.support.suites import ROOT

METHOD = ROOT / "tests" / "methods" / "nearest_hand.py"
TEXT = METHOD.read_text(encoding="utf-8")


@pytest.mark.usefixtures("in_this_process")
def test_a_file_brings_a_method(coartic, tmp_path):
    own = ("--method-file", METHOD)
    code, checked, _ = coartic("check", "nearest-hand", *own)
    assert (code, "nearest-hand: 9 of 9 checks passed." in checked) == (0, True), checked
    code, _, error = coartic(
        "run", "paper", "--methods", "nearest-hand", *own, "--jobs", "1", "--out", tmp_path,
        "--tasks", f"two-armed-1,{METHOD.with_name('shelf.toml')}",
    )  # fmt: skip
    assert code == 0, error
    runs = load(tmp_path).runs.set_index("task")
    assert runs.status.to_dict() == {"two-armed-1": "ok", "shelf": "ok"}
    assert set(runs.information) == {"corrective process, forward kinematics, goals"}
    assert (runs.forward_kinematics > 0).all()
    again = ("verify", tmp_path, "--run", runs.run_id["shelf"])
    assert coartic(*again, *own)[1].endswith("again: none with another result.\n")
    code, _, error = coartic(*again)
    assert code == 2
    assert "method 'nearest-hand' is unknown here: pass the file that defines it" in error


@pytest.mark.process
@pytest.mark.parametrize("helper", ["stepsize", "analysis", "tests"])
def test_a_helper_is_compiled_from_its_source_and_is_that_of_its_folder(helper, tmp_path):
    """Whatever bytecode there is, and also if a folder of this checkout has its name."""
    path = tmp_path / f"{helper}.py"
    for step in (0.02, 0.30):
        path.write_text(f"STEP = {step:.2f}\n", encoding="utf-8")
        os.utime(path, (1.7e9, 1.7e9))  # as from an archive
        if step == 0.02:
            py_compile.compile(path)
    text = TEXT.replace('title = "', f'title = f"{{{helper}.STEP}} of ')
    (tmp_path / "mine.py").write_text(f"import {helper}\n{text}", encoding="utf-8")
    assert registry([tmp_path / "mine.py"])["nearest-hand"].title.startswith("0.3 of ")
    assert [*tmp_path.rglob("mine*.pyc")] == []


@pytest.mark.process
def test_a_method_file_says_which_worlds_it_takes(tmp_path):
    """In the process of the file; what is no set of constants is refused."""
    path = tmp_path / "mine.py"
    text = TEXT.replace('    title = "', '    adapts_to = {"norm"}\n    title = "')
    path.write_text(text, encoding="utf-8")
    info = registry([path])["nearest-hand"]
    assert info.refuses(MotionModel(norm="maximum", motor_noise=0.01)) is None
    assert info.refuses(MotionModel()) is None
    assert "model.base_weight is 2; method 'nearest-hand'" in info.refuses(
        MotionModel(base_weight=2)
    )
    for wrong in ('"norm"', '{"weight"}'):
        path.write_text(text.replace('{"norm"}', wrong), encoding="utf-8")
        with pytest.raises(CoarticError, match="adapts_to must be None or a set of motor_noise, "):
            registry([path])


@pytest.mark.process
def test_the_old_name_of_the_reason_not_to_apply_is_refused(tmp_path):
    """Otherwise the method would run on tasks that it says it does not apply to."""
    path = tmp_path / "mine.py"
    text = f"{TEXT}\n    def why_not(self, task):\n        return 'it never applies'\n"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CoarticError, match="NearestHand: why_not is called inapplicable_reason"):
        registry([path])
    path.write_text(text.replace("why_not", "inapplicable_reason"), encoding="utf-8")
    assert registry([path])["nearest-hand"].inapplicable_reason(load_task("ascending"))


@pytest.mark.process
@pytest.mark.parametrize("value", ["math.inf", "[1.0, math.nan]"])
def test_parameters_that_json_does_not_have_are_refused(value, tmp_path):
    text = f"import math\n{TEXT}\n{PATIENT}"
    path = tmp_path / "mine.py"
    path.write_text(text.replace("VALUE", value), encoding="utf-8")
    words = r"method 'patient': patience is .*; a parameter must be finite: use None for no limit"
    with pytest.raises(CoarticError, match=words):
        registry([path])
    path.write_text(text.replace("VALUE", "2.0"), encoding="utf-8")
    with pytest.raises(CoarticError, match=words):
        registry([path])["patient"].complete({"patience": eval(value, {"math": math})})


PATIENT = """
from typing import Any
class Patience(Parameters):
    patience: Any = VALUE
class Patient(NearestHand):
    name, Parameters = "patient", Patience
"""
HARMLESS = """os.chdir('/'); print('x' * 10**6)
import coartic.benchmarks.scoring as s; s.score = s.execute_many = None
import numpy; numpy.sqrt = None
import signal; signal.signal(signal.SIGINT, signal.SIG_DFL)
"""
AT_IMPORT = {
    HARMLESS: "",
    "class Odd(BaseException): pass\nraise Odd('odd')": "cannot be imported: Odd: odd",
    "os.kill(os.getpid(), 9)": "the process that reads it ended: SIGKILL ended it",
    f"{TEXT}\nclass Data(NearestHand): name, files = 'data', ['w.npy']": "w.npy cannot be read: ",
    f"{TEXT}\nclass Twice(NearestHand): pass": "'nearest-hand' exists already",
}


@pytest.mark.process
@pytest.mark.parametrize("done", AT_IMPORT)
def test_what_a_file_does_when_it_is_imported_is_no_matter_here(done, coartic, tmp_path):
    def state():
        return Path.cwd(), np.sqrt, scoring.score, signal.getsignal(signal.SIGINT)

    before = state()
    (tmp_path / "mine.py").write_text(f"import os, sys\n{done}\n{TEXT}", encoding="utf-8")
    code, text, error = coartic("list", "nearest-hand", "--method-file", tmp_path / "mine.py")
    assert before == state()
    assert code == (2 if AT_IMPORT[done] else 0)
    assert AT_IMPORT[done] in error
    assert len(error.splitlines()) == (1 if AT_IMPORT[done] else 0)
    assert ("reluctance=0.0" in text) == (not AT_IMPORT[done])
