"""Write files and folders of files so that an interruption leaves no incomplete file."""

from __future__ import annotations

import contextlib
import errno
import os
import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from coartic.errors import CoarticError
from coartic.internal.text import plain, prints

_PART = ".coartic-"  # beginning of the name of a file that is being written
LISTING = ".coartic-files"
"""Name of a hidden file in a folder into which coartic writes. Each line of the file is the path of
a file that coartic has written into this folder, or that an interrupted command was about to
write."""


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file completely or not at all, and replace an existing file.

    The data are first written into a temporary file in the same folder, which is then renamed. If
    this fails, an existing file does not change, and OSError is raised.
    """
    part = path.with_name(f"{_PART}{os.getpid()}-{path.name}")
    try:
        part.unlink(missing_ok=True)
        with part.open("xb") as file:  # does not follow symbolic links
            file.write(data)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def publish(folder: Path, files: Mapping[str, bytes], ours: str) -> None:
    """Write files into a folder, in place of the files of earlier calls.

    Files of earlier calls that are not in ``files`` are removed; so is the subfolder of a removed
    file, if it is empty then. Files that :data:`LISTING` does not list are not changed, and files
    whose names the caller never writes are not removed, but stay listed: the list may be somebody
    else's.

    Parameters
    ----------
    folder : Path
        Folder to write into. A missing folder is made.
    files : mapping of str to bytes
        Dict that maps the path of each file, relative to the folder, to its content.
    ours : str
        Regular expression of all paths that the caller can write.

    Raises
    ------
    CoarticError
        The folder cannot be used (:func:`make_folder`), so that no file is written, or writing a
        file fails.
    """
    old_files = make_folder(folder, files)

    def list_files(names: Collection[str]) -> None:
        write_atomically(folder / LISTING, "".join(f"{name}\n" for name in sorted(names)).encode())

    with describe_os_errors(folder):
        for parent in {folder, *((folder / name).parent for name in {*old_files, *files})}:
            parent.mkdir(parents=True, exist_ok=True)
            for part in parent.glob(f"{_PART}[0-9]*"):  # of a command that was killed
                part.unlink()
        list_files({*old_files, *files})  # so that an interrupted call leaves no unknown file
        for name, data in files.items():
            write_atomically(folder / name, data)
        old_ones = {name for name in old_files - {*files} if re.fullmatch(ours, name)}
        for name in old_ones:
            (folder / name).unlink(missing_ok=True)
            with contextlib.suppress(OSError):  # the folder has other files
                (folder / name).parent.rmdir()
        list_files({*old_files, *files} - old_ones)


def make_folder(folder: Path, names: Collection[str] = ()) -> set[str]:
    """Make a folder if it is missing, and check that it can be written.

    Parameters
    ----------
    folder : Path
    names : collection of str
        Paths of the files to be written, relative to the folder.

    Returns
    -------
    set of str
        Paths of the files that :data:`LISTING` lists, relative to the folder; empty if the folder
        has no such file, or if that file contains a character that is not printable.

    Raises
    ------
    CoarticError
        One of these is the case:

        - the folder cannot be made or written;
        - one of the files to be written exists, and :data:`LISTING` does not list it;
        - the path of a listed file or of a file to be written leads out of the folder, or is a
          symbolic link.
    """
    listing = folder / LISTING
    with describe_os_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        listed = listing.read_text(encoding="utf-8", errors="replace") if listing.exists() else ""
    is_whole = all(map(prints, listed.replace("\n", "")))  # a damaged file counts as missing
    listed_files = {*listed.splitlines()} if is_whole else set[str]()
    for name in sorted({*listed_files, *names}):
        check_inside(folder, folder / name)
    if foreign := [name for name in names if name not in listed_files and (folder / name).exists()]:
        raise CoarticError(
            f"{folder} contains {plain(', '.join(foreign), 80)}, which coartic has not listed in "
            f"{LISTING}. Move it away, or choose another folder. If the folder is a copy, copy "
            "this hidden file, too."
        )
    return listed_files


def check_inside(folder: Path, path: Path) -> None:
    """Raise CoarticError if a path leads out of a folder, or is a symbolic link.

    The file at ``path`` need not exist.
    """
    home, real_paths = os.path.realpath(folder), map(os.path.realpath, (path, path.parent))
    if path.is_symlink() or not all(Path(real).is_relative_to(home) for real in real_paths):
        raise CoarticError(f"{path} leads out of {folder} by a symbolic link: remove the link")


def write_output(path: Path, data: bytes, *, replace: bool) -> None:
    """Write a file whose name the user has chosen.

    Raises CoarticError if the folder of the file does not exist, if the file exists and ``replace``
    is False, or if writing fails.
    """
    check_output(path, replace=replace)
    with describe_os_errors(path):
        write_atomically(path, data)


def check_ending(path: Path, endings: Collection[str]) -> None:
    """Raise CoarticError if the suffix of a path is not one of ``endings``.

    Upper and lower case of the suffix are treated as equal. ``endings`` are in lower case, such as
    ``".svg"``.
    """
    if path.suffix.lower() not in endings:
        *others, last = endings
        allowed = f"{', '.join(others)} or {last}" if others else last
        raise CoarticError(f"{path} has the suffix {path.suffix!r}; it must end in {allowed}")


def check_output(path: Path, *, replace: bool) -> None:
    """Raise CoarticError if a file has no folder, or exists and must not be replaced.

    An existing file may be replaced if ``replace`` is True. Permissions are not checked.
    """
    with describe_os_errors(path):
        if not path.parent.is_dir():
            raise CoarticError(f"{path} cannot be written: the folder {path.parent} does not exist")
        if path.exists() and not replace:
            raise CoarticError(
                f"{path} exists: add --replace (in Python replace=True) to replace it, or choose "
                "another name"
            )


def folder_named(name: str | Path, what: str = "the name of a folder") -> Path:
    """Convert the name of a file or folder to a path.

    The file or folder need not exist. Raises CoarticError if the name is empty or blank. The error
    message begins with ``what``, a phrase such as ``"the name of a folder"``.
    """
    if not str(name).strip():
        raise CoarticError(f"{what} is empty; for the current folder write a dot")
    return Path(name)


@contextlib.contextmanager
def describe_os_errors(path: Path) -> Iterator[None]:
    """Turn each OSError of a ``with`` block into a CoarticError.

    The error message says that ``path`` cannot be written, and why.
    """
    try:
        yield
    except OSError as error:
        raise CoarticError(f"{path} cannot be written: {error.strerror or error}") from None
