"""An archive of results: what another lab can check, and what it refuses to open."""

import hashlib
import json
import pickle
import shutil
import stat
import zipfile

import pytest

from coartic import CoarticError
from coartic.analysis import load
from coartic.analysis.results.archive import LISTED, opened, pack, unpack
from tests.support.commands import call


@pytest.mark.parametrize(("name", "written"), [(".", "v1.2.zip"), ("../v1.2", "v1.2.zip")])
def test_an_archive_is_beside_its_folder_by_its_name(
    name, written, traced, tmp_path, monkeypatch, capsys
):
    folder = shutil.copytree(traced.results.folder, tmp_path / "v1.2")
    monkeypatch.chdir(folder)
    code, text, _ = call(monkeypatch, capsys, "pack", name)
    assert (code, [path.name for path in tmp_path.glob("*.zip")]) == (0, [written])
    assert "holds the results" in text
    code, _, error = call(monkeypatch, capsys, "pack", "/")
    assert code == 2
    assert "/ is not a results folder" in error


@pytest.fixture(scope="module")
def archive(traced, tmp_path_factory):
    path = tmp_path_factory.mktemp("archive") / "results.zip"
    pack(traced.results.folder, path)
    return path


def entries(path):
    with zipfile.ZipFile(path) as file:
        return {name: file.read(name) for name in file.namelist()}


def written(path, contents, listed=None, mode=stat.S_IFREG | 0o644):
    """An archive of these contents, that lists them rightly, or as ``listed`` says."""
    files = {
        name: {"size": len(data), "sha256": hashlib.sha256(data).hexdigest()}
        for name, data in contents.items()
    }
    said = json.dumps({"format": 1, "files": files} | (listed or {})).encode()
    with zipfile.ZipFile(path, "w") as file:
        file.writestr(LISTED, said)
        for name, data in contents.items():
            entry = zipfile.ZipInfo(name)
            entry.external_attr = mode << 16
            file.writestr(entry, data)
    return path


def test_an_archive_is_the_folder(traced, archive, tmp_path):
    again = tmp_path / "again.zip"
    pack(traced.results.folder, again)
    assert again.read_bytes() == archive.read_bytes()
    with opened(archive) as folder:
        study = load(folder)
        assert study.runs.equals(traced.runs)
        assert study.run_ids == traced.run_ids
        for file in folder.rglob("*"):
            own = traced.results.folder / file.relative_to(folder)
            assert file.is_dir() or file.read_bytes() == own.read_bytes()
    assert not folder.exists()
    with opened(traced.results.folder) as same:
        assert same == traced.results.folder
    with pytest.raises(CoarticError, match="there already"):
        pack(traced.results.folder, again)


def changed(contents):
    name = next(name for name in contents if name.startswith("records/"))
    return {**contents, name: contents[name][:-1] + b"x"}


def test_what_was_changed_is_noticed(archive, tmp_path):
    contents = entries(archive)
    listed = json.loads(contents.pop(LISTED))
    path = written(tmp_path / "a.zip", changed(contents), listed)
    with pytest.raises(CoarticError, match="it was changed"), opened(path):
        pass
    # Listed as it was changed it is unpacked, and what reads it refuses it.
    path = written(tmp_path / "b.zip", changed(contents))
    with opened(path) as folder, pytest.raises(CoarticError):
        load(folder)
    for lost in ("manifest.json", "runs.parquet"):
        rest = {name: data for name, data in contents.items() if name != lost}
        path = written(tmp_path / f"{lost}.zip", rest)
        with pytest.raises(CoarticError, match="lacks some"), opened(path):
            pass
    cut = tmp_path / "cut.zip"
    cut.write_bytes(archive.read_bytes()[:-200])
    with pytest.raises(CoarticError, match="no archive that can be read"), opened(cut):
        pass


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("../outside.parquet", "no file of a results folder"),
        ("/etc/passwd", "no file of a results folder"),
        ("records/../../x.pack", "no file of a results folder"),
        ("C:\\x.parquet", "no file of a results folder"),
        ("run.py", "no file of a results folder"),
        ("records/a.pack", "no file of a results folder"),
        ("report/report.html", "no file of a results folder"),
    ],
)
def test_other_names_are_refused(archive, tmp_path, name, said):
    contents = entries(archive)
    del contents[LISTED]
    path = written(tmp_path / "a.zip", {**contents, name: b"x"})
    inside = tmp_path / "in" / "here"
    with pytest.raises(CoarticError, match=said):
        unpack(path, inside)
    assert not inside.exists()
    assert {file.name for file in tmp_path.iterdir()} == {"a.zip"}


def test_links_doubles_bombs_and_code_are_refused(archive, tmp_path):
    contents = entries(archive)
    del contents[LISTED]
    path = written(tmp_path / "link.zip", contents, mode=stat.S_IFLNK | 0o777)
    with pytest.raises(CoarticError, match="no plain file"), opened(path):
        pass
    path = written(tmp_path / "twice.zip", contents)
    with zipfile.ZipFile(path, "a") as file, pytest.warns(UserWarning, match="Duplicate"):
        file.writestr("manifest.json", b"{}")
    with pytest.raises(CoarticError, match="two files of one name"), opened(path):
        pass
    small = {"manifest.json": {"size": 10**12, "sha256": "0" * 64}}
    path = written(tmp_path / "bomb.zip", contents, {"files": small})
    with pytest.raises(CoarticError, match="damaged"), opened(path):
        pass
    path = written(tmp_path / "new.zip", contents, {"format": 2})
    with pytest.raises(CoarticError, match="format 2"), opened(path):
        pass
    path = tmp_path / "pickle.zip"
    path.write_bytes(pickle.dumps({"a": 1}))
    with pytest.raises(CoarticError, match="no archive"), opened(path):
        pass


def test_commands_read_archives(monkeypatch, capsys, traced, tmp_path):
    path = tmp_path / "results.zip"
    code, text, _ = call(monkeypatch, capsys, "pack", traced.results.folder, "--out", path)
    assert code == 0
    with zipfile.ZipFile(path) as file:
        assert hashlib.sha256(file.read(LISTED)).hexdigest() in text
    code, text, _ = call(monkeypatch, capsys, "verify", path)
    assert code == 0
    assert f"{len(traced.runs)} runs" in text
    code, text, error = call(
        monkeypatch, capsys, "pack", traced.results.folder, "--out", tmp_path / "a.tar"
    )
    assert code == 2
    assert ".zip" in error
    code, text, _ = call(monkeypatch, capsys, "compare", traced.results.folder, path)
    assert code == 0
    assert "identical in every run" in text
