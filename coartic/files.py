"""Files for users: the one place that writes, replaces and removes them.

What is not ours is never touched: a set of files (:func:`publish`) replaces and removes only
what its folder's listing names with the hash that it still has, a single file
(:func:`write_outputs`) replaces none unless told to. A listing comes with its folder, maybe from
elsewhere: names in it are compared with what is found, and never followed.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import stat
import uuid
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from io import BufferedRandom
from pathlib import Path
from typing import IO, TypeGuard

from filelock import FileLock

from coartic.errors import CoarticError
from coartic.text import plain

try:
    import fcntl
except ImportError:  # Windows, where nobody removes or replaces a file that is open
    fcntl = None  # type: ignore[assignment]

LISTING = ".coartic-files.json"
"""What commands wrote into its folder: command -> {path -> SHA-256 of what was written}, while
files are being replaced with that of the old and of the new."""
REPORT = "report"
"""The command whose folders hold nothing else."""
_LEFTOVER = re.compile(r"\.coartic-[0-9a-f]{32}\.part")
_LOCK = f".coartic-{'0' * 32}.part"  # left behind by a killed command, it is a leftover, too
_LARGEST_LISTING = 16 * 2**20  # bytes
_NAMED = 3  # files in a sentence

Listing = dict[str, dict[str, list[str]]]


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file so that it is there whole or not at all, also after a power cut.

    A power cut may undo the rename; then the old file, or none, is there. Raises OSError.
    """
    with temporary(path.parent) as part:
        part.write(data)
        _put(part, path)


@contextlib.contextmanager
def temporary(folder: Path) -> Iterator[BufferedRandom]:
    """A file to be written and then published (:func:`publish`); what is not is removed.

    Raises OSError.
    """
    path = folder / f".coartic-{uuid.uuid4().hex}.part"
    try:
        with path.open("x+b") as file:
            _hold(file)  # for clear_leftovers: its writer lives
            yield file
    finally:
        path.unlink(missing_ok=True)


def _put(part: BufferedRandom, path: Path) -> None:
    """Give a temporary file its name, once it is on the disk."""
    part.flush()
    os.fsync(part.fileno())
    if fcntl is None:
        part.close()
    os.replace(part.name, path)


def _hold(file: IO[bytes]) -> None:
    """Mark a file as in use while it is open. Raises BlockingIOError where it is already."""
    if fcntl is not None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def clear_leftovers(folder: Path, kept: Collection[Path] = ()) -> None:
    """Remove the temporary files in ``folder``, not below, whose writers were killed.

    Those of writers at work stay, and ``kept``. Raises OSError.
    """
    with os.scandir(folder) as entries:
        parts = {Path(entry.path) for entry in entries if _is_leftover(entry)}
    for part in parts.difference(kept):
        with contextlib.suppress(FileNotFoundError, BlockingIOError, PermissionError):
            with part.open("r+b") as file:
                _hold(file)
                if fcntl is not None:
                    part.unlink()
            if fcntl is None:
                part.unlink()


def publish(
    folder: Path,
    files: Mapping[str, bytes | BufferedRandom],
    *,
    owner: str,
    alone: bool,
    derived: Collection[str] = (),
) -> None:
    """Write a command's files into ``folder`` and list them there (:data:`LISTING`).

    ``files`` are contents, or files that are :func:`temporary` in the folder and move, by path
    below the folder, with slashes; ``owner`` is the command. A
    file that is there is replaced if the listing has it as this command's, unchanged since.
    ``alone``: the folder is this command's alone. What it wrote earlier and writes no longer
    is removed. Without, other files are left alone. Killed at any moment, the next call
    finishes; calls at the same time wait for each other. Files that are ``derived`` from others
    hold nothing that anybody wrote: one that is listed is replaced though it was changed.

    Raises CoarticError, before anything is written, where something else is in the way: a file
    that is not listed, or was changed; a link or a folder in a file's place; with ``alone``
    anything at all. Also where ``folder`` is among a results folder's records, is a link
    (with ``alone``), or cannot be written.
    """
    unfit = [name for name in files if not _is_fit(name)]
    if unfit:
        raise ValueError(f"no names for files: {', '.join(map(repr, unfit))}")
    digests = {name: digest_of(content) for name, content in files.items()}
    own = {Path(part.name) for part in files.values() if not isinstance(part, bytes)}
    with _errors(folder):
        _check_place(folder, alone)
        folder.mkdir(parents=True, exist_ok=True)
        with _locked(folder):
            listing = _read_listing(folder)
            found = _survey(folder, digests, listing.get(owner, {}), owner, alone, derived)
            for place in ("", *found.folders):
                clear_leftovers(folder / place, own)
            kept = {} if alone else listing.get(owner, {})
            final = {**listing, owner: kept | {name: [known] for name, known in digests.items()}}
            fresh = [name for name in files if found.digests.get(name) != digests[name]]
            gone = found.digests.keys() - files.keys()
            if fresh or gone:  # whatever happens now, the listing knows both old and new
                both = {name: [known] for name, known in found.digests.items()}
                for name in fresh:
                    both[name] = [*both.get(name, []), digests[name]]
                _write_listing(folder, listing | {owner: kept | both})
            for name in fresh:
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                content = files[name]
                if isinstance(content, bytes):
                    write_atomically(folder / name, content)
                else:
                    _put(content, folder / name)
            for name in gone:
                (folder / name).unlink()
            for place in reversed(found.folders):
                if not _is_above(place, files):
                    (folder / place).rmdir()
            if final != listing:
                _write_listing(folder, final)


def digest_of(content: bytes | IO[bytes]) -> str:
    """SHA-256 of bytes, or of a file from its beginning."""
    if isinstance(content, bytes):
        return hashlib.sha256(content).hexdigest()
    content.seek(0)
    return hashlib.file_digest(content, "sha256").hexdigest()  # type: ignore[arg-type]


def holds(folder: Path, names: Iterable[str], *, owner: str) -> bool:
    """Whether files of these names are all there as the command ``owner`` wrote them last.

    Raises CoarticError where the list of them is damaged.
    """
    with _errors(folder):
        listed = _read_listing(folder).get(owner, {})
        for name in names:
            path = folder / name
            if path.is_symlink() or not path.is_file():
                return False
            with path.open("rb") as file:
                if listed.get(name) != [digest_of(file)]:
                    return False
    return True


def check_folder(
    folder: Path,
    *,
    owner: str,
    alone: bool,
    names: Collection[str] = (),
    derived: Collection[str] = (),
) -> None:
    """Raises CoarticError where :func:`publish` would for what is in the way now.

    For those who work long before they write; ``names`` are the files to be.
    """
    with _errors(folder):
        _check_place(folder, alone)
        if folder.exists():
            with _locked(folder):
                listed = _read_listing(folder).get(owner, {})
                _survey(folder, dict.fromkeys(names, ""), listed, owner, alone, derived)


def folder_named(name: object, what: str = "the name of a folder") -> Path:
    """A folder by its name. Raises CoarticError for an empty one, which is not the current one,
    and for what is no name."""
    if not isinstance(name, str | Path):
        raise CoarticError(f"folder is {name!r}; it must be a path")
    if isinstance(name, str) and not name.strip():
        raise CoarticError(f"{what} is empty; the current folder is .")
    return Path(name)


def check_no_report(folder: Path) -> None:
    """Raises CoarticError for a folder that a report was written into: it holds nothing else."""
    with _errors(folder):
        if REPORT in _read_listing(folder):
            raise CoarticError(
                f"{folder} holds a report, and nothing else is written there; name another folder"
            )


def write_outputs(files: Mapping[Path, bytes], *, replace: bool) -> None:
    """Write single files, each whole or not at all, none where one of them may not be.

    Raises CoarticError as :func:`check_outputs` does, and where the disk does not take one.
    """
    check_outputs(files, replace=replace)
    for path, data in files.items():
        with _errors(path):
            clear_leftovers(path.parent)
            write_atomically(path, data)


def check_outputs(paths: Iterable[Path], *, replace: bool) -> None:
    """Raises CoarticError where a file may not be written: its name has no folder, is that of
    a folder or a link, is among a results folder's records, or, without ``replace``, is taken.
    """
    for path in paths:
        with _errors(path):
            _outside_records(path)
            if not path.parent.is_dir():
                raise CoarticError(f"cannot write {path}: there is no folder {path.parent}")
            if not os.path.lexists(path):
                continue
            if path.is_symlink():
                raise CoarticError(f"cannot write {path}: it is a link; name what it leads to")
            if not path.is_file():
                raise CoarticError(f"cannot write {path}: what is there is no file")
            if not replace:
                raise CoarticError(
                    f"{path} is there already; add --replace to write over it, or choose "
                    "another name"
                )


@dataclass
class _Found:
    """What of a command's is in a folder already."""

    digests: dict[str, str] = field(default_factory=dict)
    """Files by their paths."""
    folders: list[str] = field(default_factory=list)
    """Each before those below it."""


def _survey(
    folder: Path,
    digests: Mapping[str, str],
    listed: Mapping[str, list[str]],
    owner: str,
    alone: bool,
    derived: Collection[str] = (),
) -> _Found:
    """Look at what is in the folder; without ``alone`` only in the places of ``digests``.

    Raises CoarticError where something is in the way. Follows no links below the folder.
    """
    ours = {*digests, *listed} if alone else set(digests)
    found = _Found()
    foreign: list[str] = []
    changed: list[str] = []
    pending = [""]
    while pending:
        above = pending.pop()
        with os.scandir(folder / above) as scan:
            entries = sorted(scan, key=lambda entry: entry.name)
        for entry in entries:
            name = above + entry.name
            if name == LISTING or _is_leftover(entry):
                continue
            if name in ours and entry.is_file(follow_symlinks=False):
                with open(entry.path, "rb") as file:
                    digest = digest_of(file)
                known = listed.get(name, [])
                ours_still = digest in known or (known and name in derived)
                if ours_still or digest == digests.get(name):
                    found.digests[name] = digest
                else:
                    (changed if known else foreign).append(name)
            elif entry.is_dir(follow_symlinks=False) and _is_above(name, ours):
                found.folders.append(name)
                pending.append(f"{name}/")
            elif alone or name in digests or _is_above(name, digests):
                foreign.append(name)
    for names, what in (
        (foreign, f"not listed there as written by `coartic {owner}`"),
        (changed, f"changed since `coartic {owner}` wrote {_them(changed)}"),
    ):
        if names:
            otherwise = ", or choose another folder" if alone else ""
            raise CoarticError(
                f"{folder} holds {_some(names)}, {what}; move {_them(names)} away{otherwise}"
            )
    return found


def _read_listing(folder: Path) -> Listing:
    """What the folder's listing says. Raises CoarticError where it is none."""
    path = folder / LISTING
    try:
        found = path.lstat()
    except FileNotFoundError:
        return {}
    listing = None
    if stat.S_ISREG(found.st_mode) and found.st_size <= _LARGEST_LISTING:
        with contextlib.suppress(ValueError, RecursionError):
            listing = json.loads(path.read_bytes())
    if not _is_listing(listing):
        raise CoarticError(
            f"{path} is no list of the files that coartic wrote, or damaged; move it away, and "
            "these files with it"
        )
    return listing


def _is_listing(found: object) -> TypeGuard[Listing]:
    return isinstance(found, dict) and all(
        isinstance(files, dict)
        and all(
            isinstance(digests, list) and all(isinstance(digest, str) for digest in digests)
            for digests in files.values()
        )
        for files in found.values()
    )


def _write_listing(folder: Path, listing: Listing) -> None:
    text = json.dumps(listing, indent=1, sort_keys=True)
    write_atomically(folder / LISTING, f"{text}\n".encode())


def _check_place(folder: Path, alone: bool) -> None:
    """Raises CoarticError where no set of files may be written, whatever is there."""
    _outside_records(folder)
    if alone and folder.is_symlink():
        raise CoarticError(f"{folder} is a link; name the folder that it leads to")
    if os.path.lexists(folder) and not folder.is_dir():
        raise CoarticError(f"cannot write {folder}: what is there is no folder")


def _outside_records(path: Path) -> None:
    """Raises CoarticError for a place in the records of a results folder, or for these."""
    real = Path(os.path.realpath(path))
    for place in (real, *real.parents):
        marks = place / ".lock", place.parent / "manifest.json"
        if place.name == "records" and any(map(os.path.lexists, marks)):
            raise CoarticError(
                f"cannot write {path}: it is among the records of {place.parent}, which only "
                "`coartic run` writes"
            )


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep other commands out of ``folder``, after those at work there. Raises OSError.

    Nothing is left of the lock, so that a folder of somebody else's stays as it was.
    """
    path = folder / _LOCK
    while fcntl is not None:
        number = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        with open(number, "r+b") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            if not _is_at(path, file):
                continue  # its last holder has removed it
            try:
                yield
            finally:
                path.unlink(missing_ok=True)
            return
    with FileLock(path):
        yield


def _is_at(path: Path, file: IO[bytes]) -> bool:
    try:
        return os.path.samestat(path.lstat(), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


@contextlib.contextmanager
def _errors(path: Path) -> Iterator[None]:
    """What the system says, as a sentence."""
    try:
        yield
    except OSError as error:
        raise CoarticError(f"cannot write {path}: {error.strerror or error}") from None


def _is_leftover(entry: os.DirEntry[str]) -> bool:
    return bool(_LEFTOVER.fullmatch(entry.name)) and entry.is_file(follow_symlinks=False)


def _is_fit(name: str) -> bool:
    """Whether a path leads below its folder, to a name that is not kept for ourselves."""
    *_, last = parts = name.split("/")
    ours = last == LISTING or _LEFTOVER.fullmatch(last)
    return not ours and "\0" not in name and not {"", ".", ".."}.intersection(parts)


def _is_above(folder: str, names: Iterable[str]) -> bool:
    """Whether a file of these is in the folder, or below it."""
    return any(name.startswith(f"{folder}/") for name in names)


def _some(names: list[str]) -> str:
    """Files in a sentence; a folder may hold a thousand."""
    shown = [plain(name) for name in names[:_NAMED]]
    more = len(names) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")


def _them(names: list[str]) -> str:
    return "it" if len(names) == 1 else "them"
