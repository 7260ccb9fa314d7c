"""Whether all that the built site links to is there: `python docs/check_links.py build/docs`.

Files and anchors within the site, without a network; links elsewhere are counted.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """Links of a page, and what can be linked to in it."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep what matters of a tag."""
        for name, value in attrs:
            if value and name in ("href", "src"):
                self.links.add(value)
            elif value and name in ("id", "name"):
                self.anchors.add(value)


def broken(site: Path) -> tuple[list[str], int]:
    """Links that lead nowhere, and how many lead elsewhere."""
    # The report is made and tested by itself; what it links to are files beside it.
    files = [path for path in sorted(site.rglob("*.html")) if path != site / "example.html"]
    pages = {path.resolve(): Page(path) for path in files}
    lost, elsewhere = [], 0
    for path, page in pages.items():
        for link in sorted(page.links):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                elsewhere += 1
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if target.is_dir():
                target /= "index.html"
            anchor = unquote(parts.fragment)
            known = pages[target].anchors if target in pages else set()
            if not target.exists() or (anchor and target in pages and anchor not in known):
                lost.append(f"{path.relative_to(site.resolve())}: {link}")
    return lost, elsewhere


if __name__ == "__main__":
    lost, elsewhere = broken(Path(sys.argv[1]))
    print(*lost, sep="\n", end="\n" if lost else "")
    print(f"{len(lost)} links of the site lead nowhere; {elsewhere} lead elsewhere.")
    sys.exit(bool(lost))
