"""A results folder as one file that another lab can read, check and compare.

An archive is a zip file of the folder's tables, records and pages, and of a list of them with
their sizes and SHA-256 digests. It holds data alone (Parquet, JSON, CSV, Markdown, text), and
nothing in it is run when it is opened: names that are not those of a results folder, links, and
contents that differ from the list are refused before anything is read.
"""

from __future__ import annotations

import hashlib
import io
import re
import stat
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from coartic import CoarticError
from coartic.analysis.results.folder import load_results
from coartic.files import folder_named, write_outputs

FORMAT = 1
LISTED = "coartic-archive.json"
"""The list of an archive's files, the first in it."""
LARGEST = 4 * 1024**3
"""Bytes that an archive holds, unpacked."""
_NAME = re.compile(
    r"manifest\.json|(runs|solutions|paths|learning|sequences)\.parquet|methods\.csv"
    r"|comparison\.md|records/\d{1,12}\.pack"
)
_NEEDED = {"manifest.json", "runs.parquet", "sequences.parquet", "solutions.parquet"}
_EARLIEST = (1980, 1, 1, 0, 0, 0)  # a zip file knows no earlier date, and no date at all
_CHUNK = 1024 * 1024


class _Listed(BaseModel):
    """A file of an archive."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    size: Annotated[int, Field(ge=0, le=LARGEST)]
    sha256: Annotated[str, Field(pattern="[0-9a-f]{64}")]


class _Archive(BaseModel):
    """What an archive says that it holds."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    format: int
    files: dict[str, _Listed]


def pack(folder: Path, path: Path, *, replace: bool = False) -> str:
    """Write a results folder into an archive and return the SHA-256 digest of its list.

    The same folder gives the same file. Raises CoarticError where the folder is not a finished
    results folder that agrees with itself
    (:func:`~coartic.analysis.results.folder.load_results`), or the file cannot be written.
    """
    load_results(folder)
    names = sorted(
        name
        for file in folder.rglob("*")
        if _NAME.fullmatch(name := file.relative_to(folder).as_posix()) and _is_file(file)
    )
    contents = {name: (folder / name).read_bytes() for name in names}
    listed = _Archive(
        format=FORMAT,
        files={
            name: _Listed(size=len(data), sha256=hashlib.sha256(data).hexdigest())
            for name, data in contents.items()
        },
    )
    first = listed.model_dump_json(indent=1).encode()
    write_outputs({path: _zipped({LISTED: first, **contents})}, replace=replace)
    return hashlib.sha256(first).hexdigest()


@contextmanager
def opened(path: Path) -> Iterator[Path]:
    """A results folder: the one of this name, or that of an archive, unpacked for as long.

    Raises CoarticError for an archive that is damaged, too large, or holds what no results
    folder does.
    """
    if not path.is_file():
        yield folder_named(path)
        return
    with TemporaryDirectory(prefix="coartic-") as temporary:
        folder = Path(temporary) / path.stem
        unpack(path, folder)
        yield folder


def unpack(path: Path, folder: Path) -> None:
    """Write an archive's files into a new folder, each checked against the list.

    Raises CoarticError as :func:`opened` does.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            listed = _listed(path, archive)
            for name, entry in listed.items():
                file = folder / name
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(_content(path, archive, name, entry))
    except (zipfile.BadZipFile, zipfile.LargeZipFile, NotImplementedError, EOFError) as error:
        raise CoarticError(f"{path} is no archive that can be read: {error}") from None
    except (OSError, RuntimeError) as error:  # a compressed stream that is none, a password
        raise CoarticError(f"{path} cannot be unpacked: {error}") from None


def _is_file(file: Path) -> bool:
    return file.is_file() and not file.is_symlink()


def _zipped(contents: Mapping[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name, data in contents.items():
            entry = zipfile.ZipInfo(name, _EARLIEST)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (stat.S_IFREG | 0o644) << 16
            archive.writestr(entry, data)
    return stream.getvalue()


def _listed(path: Path, archive: zipfile.ZipFile) -> dict[str, _Listed]:
    """The files of an archive as it lists them, which must be those that it has."""
    entries = archive.infolist()
    names = [entry.filename for entry in entries]
    if names.count(LISTED) != 1:
        raise CoarticError(f"{path} is no archive of results: it has no {LISTED}")
    if len(set(names)) < len(names):
        raise CoarticError(f"{path} has two files of one name")
    for entry in entries:
        kind = stat.S_IFMT(entry.external_attr >> 16)
        if kind not in (0, stat.S_IFREG) or entry.is_dir():
            raise CoarticError(f"{path}: {entry.filename!r} is no plain file")
        if entry.filename != LISTED and not _NAME.fullmatch(entry.filename):
            raise CoarticError(f"{path}: {entry.filename!r} is no file of a results folder")
    if sum(entry.file_size for entry in entries) > LARGEST:
        raise CoarticError(f"{path} would unpack to more than {LARGEST / 1e9:.1f} GB")
    with archive.open(LISTED) as file:
        said = file.read(64 * _CHUNK)
    try:
        listed = _Archive.model_validate_json(said)
    except ValidationError as error:
        raise CoarticError(f"{path}: {LISTED} is damaged ({error.errors()[0]['msg']})") from None
    if listed.format != FORMAT:
        raise CoarticError(
            f"{path} is an archive of format {listed.format}; this version reads {FORMAT}"
        )
    if listed.files.keys() != set(names) - {LISTED} or not listed.files.keys() >= _NEEDED:
        raise CoarticError(f"{path} does not hold the files that it lists, or lacks some")
    return listed.files


def _content(path: Path, archive: zipfile.ZipFile, name: str, entry: _Listed) -> bytes:
    """A file's bytes, no more of them than are listed."""
    parts, left = [], entry.size
    with archive.open(name) as file:
        while left >= 0:
            part = file.read(min(_CHUNK, left + 1))
            if not part:
                break
            parts.append(part)
            left -= len(part)
    data = b"".join(parts)
    if len(data) != entry.size or hashlib.sha256(data).hexdigest() != entry.sha256:
        raise CoarticError(f"{path}: {name} is not what the archive lists: it was changed")
    return data
