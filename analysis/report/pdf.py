"""A report's page as a PDF, by a browser that the machine has."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from coartic import CoarticError

BROWSERS = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
    *("microsoft-edge", "msedge", "brave-browser"),
)
"""Programs that print a page, the first that there is."""
_SECONDS = 300
_QUIET = (
    *("--headless", "--disable-gpu", "--no-first-run", "--disable-sync", "--disable-quic"),
    *("--disable-background-networking", "--disable-component-update", "--disable-extensions"),
    "--no-pdf-header-footer",
)


def pdf(page: bytes) -> bytes:
    """A page of HTML that needs no other file, printed. Its date is that of the printing.

    Raises CoarticError where there is no browser, or it prints nothing.
    """
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise CoarticError(
            f"--pdf needs a browser to print with, one of {', '.join(BROWSERS)}; or open "
            "report.html in yours and print it, or compile tables.tex with LaTeX"
        )
    with TemporaryDirectory(prefix="coartic-") as temporary:
        source, target = Path(temporary) / "report.html", Path(temporary) / "report.pdf"
        source.write_bytes(page)
        command = [found, *_QUIET, f"--user-data-dir={temporary}/profile"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:  # a browser has no sandbox for root
            command.append("--no-sandbox")
        command += [f"--print-to-pdf={target}", source.as_uri()]
        try:
            done = subprocess.run(command, capture_output=True, check=False, timeout=_SECONDS)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise CoarticError(f"{found} prints no PDF: {error}") from None
        if done.returncode or not target.is_file():
            last = done.stderr.decode(errors="replace").strip().split("\n")[-1]
            raise CoarticError(f"{found} prints no PDF: {last or f'exit code {done.returncode}'}")
        return target.read_bytes()
