"""Prints the articles as build/coartic-replication.pdf and build/coartic-ahead.pdf:
``python docs/print_paper.py``.

It needs Chromium; the environment variable COARTIC_BROWSER names one that is not on the path.
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

from markdown_it import MarkdownIt
from playwright.sync_api import sync_playwright

DOCS = Path(__file__).parent
BUILD = DOCS.parent / "build"
ARTICLES = {"paper.md": "coartic-replication.pdf", "ahead.md": "coartic-ahead.pdf"}
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def article(name: str) -> str:
    """An article as a page of HTML that reads its figures from docs."""
    text = (DOCS / name).read_text("utf-8")
    body = MarkdownIt("commonmark").enable("table").render(text)
    # On paper, a link to another page of the site is the path of that page.
    link = r'<a href="([\w/-]+\.md)[^"]*">(.*?)</a>'
    body = re.sub(rf"\({link}\)", r"(<code>docs/\1</code>)", body)
    body = re.sub(link, r"\2 (<code>docs/\1</code>)", body)
    body = re.sub(r"(?<=[\d\]]) %", "\N{NO-BREAK SPACE}%", body)
    # A figure stays on one page with its caption, and a table with the caption above it.
    body = re.sub(
        r"<p>(<img[^>]*>)</p>\s*<p><em>(Figure \d+\.)(.*?)</em></p>",
        r"<figure>\1<figcaption><b>\2</b>\3</figcaption></figure>",
        body,
        flags=re.DOTALL,
    )
    body = re.sub(
        r"<p><em>(Table \d+\.)(.*?)</em></p>\s*<table>(.*?)</table>",
        r"<table><caption><b>\1</b>\2</caption>\3</table>",
        body,
        flags=re.DOTALL,
    )
    title = re.search("<h1>(.*?)</h1>", body)
    assert title
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title[1]}</title>'
        f'<base href="{DOCS.as_uri()}/"><link rel="stylesheet" href="paper.css">{body}</html>'
    )


def main() -> None:
    """Print both."""
    browser = os.environ.get("COARTIC_BROWSER") or next(
        filter(None, map(shutil.which, BROWSERS)), ""
    )
    if not browser:
        raise SystemExit("No Chromium is installed; set COARTIC_BROWSER to the one to use.")
    BUILD.mkdir(exist_ok=True)
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        for name, printed in ARTICLES.items():
            pdf = BUILD / printed
            page = pdf.with_suffix(".html")
            page.write_text(article(name), encoding="utf-8")
            opened = started.new_page()
            opened.goto(page.as_uri(), wait_until="load")
            opened.pdf(path=pdf, prefer_css_page_size=True, print_background=True, tagged=True)
            opened.close()
            page.unlink()
            print(f"Look at {pdf}.")
        started.close()


if __name__ == "__main__":
    main()
