"""Files for users: written whole or not at all, and never over what is not ours."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from coartic.errors import CoarticError
from coartic.text import plain

LISTING = ".coartic-files"
"""In a folder: the files that a command wrote into it, a path a line."""


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file so that it is there whole or not at all. Raises OSError."""
    beside = path.with_name(f".coartic-{os.getpid()}-{path.name}")
    try:
        beside.unlink(missing_ok=True)
        with beside.open("xb") as file:  # which follows no link
            file.write(data)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def publish(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder, by their paths below it; replace those that were written so
    before, and remove those of them that are written no more.

    Raises CoarticError, before anything is written, where another file is in the way.
    """
    make_folder(folder, files)
    with errors_in_words(folder):
        before = listed_files(folder)
        write_listing(folder, {*before, *files})  # whatever happens now, all of them are known
        for name, data in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            write_atomically(folder / name, data)
        for name in before - {*files}:
            (folder / name).unlink(missing_ok=True)
            with contextlib.suppress(OSError):  # others are in it
                (folder / name).parent.rmdir()
        write_listing(folder, {*files})


def check_inside(folder: Path, path: Path) -> None:
    """Raises CoarticError for a path of a folder that is a link or leads out of it by one."""
    if path.is_symlink() or not Path(os.path.realpath(path)).is_relative_to(
        os.path.realpath(folder)
    ):
        raise CoarticError(f"{path} leads out of {folder} by a link: remove the link")


def make_folder(folder: Path, names: Collection[str] = ()) -> None:
    """Make a folder for :func:`publish`, for those who work long before. Raises CoarticError where
    that would."""
    if os.path.lexists(folder) and not folder.is_dir():
        raise CoarticError(f"cannot write {folder}: what is there is no folder")
    ours = listed_files(folder)
    for name in sorted({*ours, *names}):
        check_inside(folder, folder / name)
    in_the_way = [name for name in names if name not in ours and os.path.lexists(folder / name)]
    if in_the_way:
        shown = ", ".join(map(plain, in_the_way[:3]))
        more = f" and {len(in_the_way) - 3} more" if len(in_the_way) > 3 else ""
        raise CoarticError(
            f"{folder} holds {shown}{more}, which coartic did not write there. Move it away or "
            "choose another folder."
        )
    with errors_in_words(folder):
        folder.mkdir(parents=True, exist_ok=True)


def write_output(path: Path, data: bytes, *, replace: bool) -> None:
    """Write a single file, whole or not at all.

    Raises CoarticError as :func:`check_output` does, and where the disk does not take it.
    """
    check_output(path, replace=replace)
    with errors_in_words(path):
        write_atomically(path, data)


def check_output(path: Path, *, replace: bool) -> None:
    """Raises CoarticError where a file may not be written: its name has no folder, is that of
    a folder or a link, or, without ``replace``, is taken."""
    if not path.parent.is_dir():
        raise CoarticError(f"cannot write {path}: there is no folder {path.parent}")
    if path.is_symlink():
        raise CoarticError(f"cannot write {path}: it is a link; name what it leads to")
    if path.exists() and not path.is_file():
        raise CoarticError(f"cannot write {path}: what is there is no file")
    if path.exists() and not replace:
        raise CoarticError(
            f"{path} is there already; add --replace to write over it, or choose another name"
        )


def folder_named(name: str | Path, what: str = "the name of a folder") -> Path:
    """A folder by its name. Raises CoarticError for an empty one, which is not the current one, and
    for one that no folder can have."""
    if isinstance(name, str) and not name.strip():
        raise CoarticError(f"{what} is empty; the current folder is .")
    try:
        with contextlib.suppress(FileNotFoundError, NotADirectoryError, PermissionError):
            os.lstat(name)  # ValueError: a NUL in the name
        return Path(name)
    except (OSError, ValueError, TypeError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise CoarticError(f"{what} {plain(repr(name), 80)} cannot be used: {reason}") from None


def listed_files(folder: Path) -> set[str]:
    """What an earlier call wrote; folders and names that lead elsewhere are none of it."""
    path = folder / LISTING
    if path.is_symlink() or not path.is_file():
        return set()
    try:
        names = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return set()
    inside = (name for name in names if name and not Path(name).is_absolute() and ".." not in name)
    return {name for name in inside if not (folder / name).is_dir()}


def write_listing(folder: Path, names: Iterable[str]) -> None:
    """Say which files in a folder are ours."""
    text = "".join(f"{name}\n" for name in sorted(names))
    write_atomically(folder / LISTING, text.encode())


@contextlib.contextmanager
def errors_in_words(path: Path) -> Iterator[None]:
    """What the system says, as a sentence."""
    try:
        yield
    except OSError as error:
        raise CoarticError(f"cannot write {path}: {error.strerror or error}") from None
