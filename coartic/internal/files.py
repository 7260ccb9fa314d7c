"""Files for users, each written whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from coartic.errors import CoarticError
from coartic.internal.text import plain

_PART = ".coartic-"  # beginning of the name of a file that is being written
LISTING = ".coartic-files"
"""File in a folder that lists the files that a command wrote there, or began to, a path a line."""


def write_atomically(path: Path, data: bytes) -> None:
    """Write ``data`` as file ``path``, in place of an earlier file; if writing fails, the earlier
    file stays as it was, and OSError is raised."""
    part = path.with_name(f"{_PART}{os.getpid()}-{path.name}")
    try:
        part.unlink(missing_ok=True)
        with part.open("xb") as file:  # which follows no link
            file.write(data)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def publish(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write ``files``, contents by path below the folder, which is made if it is missing. Files
    that an earlier call wrote there are replaced, or removed if they are not among ``files``.
    Raises CoarticError as :func:`make_folder`, before a file is written, and if writing fails."""
    before = make_folder(folder, files)

    def list_files(names: Collection[str]) -> None:
        write_atomically(folder / LISTING, "".join(f"{name}\n" for name in sorted(names)).encode())

    with errors_in_words(folder):
        for parent in {folder, *((folder / name).parent for name in {*before, *files})}:
            parent.mkdir(parents=True, exist_ok=True)
            for part in parent.glob(f"{_PART}[0-9]*"):  # of a command that was killed
                part.unlink()
        list_files({*before, *files})  # whatever happens now, all of them are known
        for name, data in files.items():
            write_atomically(folder / name, data)
        for name in before - {*files}:
            (folder / name).unlink(missing_ok=True)
            with contextlib.suppress(OSError):  # others are in it
                (folder / name).parent.rmdir()
        list_files(files)


def make_folder(folder: Path, names: Collection[str] = ()) -> set[str]:
    """Make a folder, if it is missing, and return the paths of files, below the folder, that
    :data:`LISTING` there lists. Raises CoarticError if the folder cannot be written, if another
    file has a path among ``names``, or if a listed path or one of ``names`` leads out of it."""
    listing = folder / LISTING
    with errors_in_words(folder):
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        listed = listing.read_text(encoding="utf-8", errors="replace") if listing.exists() else ""
    ours = {*listed.splitlines()}
    for name in sorted({*ours, *names}):
        check_inside(folder, folder / name)
    if other := [name for name in names if name not in ours and (folder / name).exists()]:
        raise CoarticError(
            f"{folder} holds {plain(', '.join(other), 80)}, which coartic did not write "
            "there. Move it away or choose another folder."
        )
    return ours


def check_inside(folder: Path, path: Path) -> None:
    """Raise CoarticError if ``path``, which need not exist, is a symbolic link or the folder
    itself, or leads out of ``folder``, such as by a link."""
    home, places = os.path.realpath(folder), map(os.path.realpath, (path, path.parent))
    if path.is_symlink() or not all(Path(place).is_relative_to(home) for place in places):
        raise CoarticError(f"{path} leads out of {folder} by a link: remove the link")


def write_output(path: Path, data: bytes, *, replace: bool) -> None:
    """Write ``data`` as a file, whole or not at all. Raises CoarticError as :func:`check_output`,
    and if writing fails."""
    check_output(path, replace=replace)
    with errors_in_words(path):
        write_atomically(path, data)


def check_ending(path: Path, endings: Collection[str]) -> None:
    """Raise CoarticError unless the suffix of a path, such as ``.svg`` or ``.SVG``, is one of
    ``endings``, which are in small letters."""
    if path.suffix.lower() not in endings:
        raise CoarticError(f"{path}: the name must end in {' or '.join(endings)}")


def check_output(path: Path, *, replace: bool) -> None:
    """Raise CoarticError if the folder of a file is missing, or if the file exists and ``replace``
    is False."""
    with errors_in_words(path):
        if not path.parent.is_dir():
            raise CoarticError(f"cannot write {path}: there is no folder {path.parent}")
        if path.exists() and not replace:
            raise CoarticError(
                f"{path} is there already; add --replace (in Python replace=True) to write over "
                "it, or choose another name"
            )


def folder_named(name: str | Path, what: str = "the name of a folder") -> Path:
    """Return the name of a file or folder, which need not exist, as a path. Raises CoarticError,
    which calls the name ``what``, for a blank name, which would be the current folder."""
    if not str(name).strip():
        raise CoarticError(f"{what} is empty; the current folder is .")
    return Path(name)


@contextlib.contextmanager
def errors_in_words(path: Path) -> Iterator[None]:
    """Turn an OSError raised in the block of this context into a CoarticError that says that
    ``path`` cannot be written, and why."""
    try:
        yield
    except OSError as error:
        raise CoarticError(f"cannot write {path}: {error.strerror or error}") from None
