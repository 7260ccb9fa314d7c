"""Smaller SVG: what matplotlib writes, in fewer bytes and looking the same.

Of the suite ``comparison`` the figures of a report take 2.1 MB, in the page and in files, instead
of 6.0 MB; with nothing but rounded coordinates they would take 4.4 MB.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

_FINE, _COARSE, _MANY = 100, 10, 120
"""Coordinates are whole multiples of 1/100 pt, of curves with many numbers 1/10 pt."""
_PATH = re.compile(r"[A-Za-z]|-?(?:\d+\.?\d*|\.\d+)(?:e-?\d+)?")
_POINTS = {"M": 1, "L": 1, "Q": 2, "C": 3}
_FONT = re.compile(r"font: (?:(bold|\d00) )?([\d.]+)px [^;\"]*")
_DIGITS = re.compile(r"-?\d+\.\d{3,}")
_DRAWN = re.compile(r"<(?:use|text)\b[^>]*>")


def compact(text: str) -> str:
    """The SVG of a figure with short ids, relative paths and without idle groups.

    Nothing moves by more than half a step of coordinates. Text that is text gets its family
    from the root.
    """
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = _FONT.sub(_sized, text)
    text = re.sub(r' d="([^"]*)"', lambda m: f' d="{relative(m[1])}"', text, flags=re.DOTALL)
    text = re.sub(r"; font-family: [^;\"]*", "", text)
    text = _DRAWN.sub(_rounded, text)
    text = re.sub(r' style="[^"]*"', lambda m: re.sub("([;:]) ", r"\1", m[0]), text)
    text = _marks_alone(text)
    text = _short_ids(text)
    text = re.sub(r"\s*\n\s*", "\n", text)
    before = ""
    while before != text:
        before = text
        text = re.sub(r"<g>\s*((?:(?!</?g\b).)*?)</g>\n?", r"\1", text, flags=re.DOTALL)
    return text


def relative(path: str) -> str:
    """A path's data with relative, rounded coordinates; points that add nothing are left out.

    Errors do not add up: differences are taken between rounded points.
    """
    found = _PATH.findall(path)
    steps = _FINE if len(found) <= _MANY else _COARSE
    tokens = iter(found)
    out: list[str] = []
    at, start, run = (0, 0), (0, 0), (0, 0)  # run: a straight stretch not yet written
    last = ""

    def write(command: str, *numbers: int) -> None:
        nonlocal last
        # A minus separates as well as a space.
        words = " ".join(_decimal(number, steps) for number in numbers).replace(" -", "-")
        if command == last and command not in "mz":  # said once for several
            out.append(words if words.startswith("-") else f" {words}")
        else:
            out.append(command + words)
        last = command

    def flush() -> None:
        nonlocal run
        if run[0] and run[1]:
            write("l", *run)
        elif run[0]:
            write("h", run[0])
        elif run[1]:
            write("v", run[1])
        run = (0, 0)

    for command in tokens:
        if command == "z":
            flush()
            write("z")
            at = start
            continue
        points = [
            (round(float(next(tokens)) * steps), round(float(next(tokens)) * steps))
            for _ in range(_POINTS[command])
        ]
        if command == "L":
            step = (points[0][0] - at[0], points[0][1] - at[1])
            if not _ahead(run, step):
                flush()
            run = (run[0] + step[0], run[1] + step[1])
        elif command == "M":
            flush()
            write("m" if out else "M", *_from(at if out else (0, 0), points))
            start = points[0]
        else:
            flush()
            write(command.lower(), *_from(at, points))
        at = points[-1]
    flush()
    return "".join(out)


def _ahead(run: tuple[int, int], step: tuple[int, int]) -> bool:
    """Whether a step goes on in the direction of a stretch, exactly."""
    across = run[0] * step[1] - run[1] * step[0]
    return across == 0 and run[0] * step[0] + run[1] * step[1] >= 0


def _from(at: tuple[int, int], points: list[tuple[int, int]]) -> Iterator[int]:
    for x, y in points:
        yield x - at[0]
        yield y - at[1]


def _decimal(number: int, steps: int = _FINE) -> str:
    """So many steps without idle zeros."""
    text = f"{number / steps:.{len(str(steps)) - 1}f}".rstrip("0").rstrip(".")
    return re.sub(r"^(-?)0(?=\.)", r"\1", text)


def _rounded(match: re.Match[str]) -> str:
    """A drawn element with its place rounded, and not turned by nothing."""
    tag = re.sub(r' transform="rotate\(-?0 [^"]*\)"', "", match[0])
    # A letter of a word that is drawn as paths.
    tag = re.sub(r' transform="translate\((\S+) 0\)"', r' x="\1"', tag)
    places = r'( (?:x|y|transform)=")([^"]*)'
    return re.sub(places, lambda m: m[1] + _DIGITS.sub(_hundredths, m[2]), tag)


def _hundredths(match: re.Match[str]) -> str:
    return _decimal(round(float(match[0]) * _FINE))


def _sized(match: re.Match[str]) -> str:
    weight = f"font-weight:{match[1]};" if match[1] else ""
    return f"{weight}font-size:{match[2]}px"


def _marks_alone(text: str) -> str:
    """Marks say how they look; what is said again where they are used has no effect."""
    own = {
        name: {entry.partition(":")[0] for entry in style.split(";")}
        for name, style in re.findall(r'<path id="([^"]*)"[^>]* style="([^"]*)"', text)
    }

    def used(match: re.Match[str]) -> str:
        kept = [e for e in match[3].split(";") if e.partition(":")[0] not in own.get(match[1], ())]
        style = f' style="{";".join(kept)}"' if kept else ""
        return f'<use xlink:href="#{match[1]}"{match[2]}{style}/>'

    return re.sub(r'<use xlink:href="#([^"]*)"([^>]*?) style="([^"]*)"/>', used, text)


def _short_ids(text: str) -> str:
    """Ids that something refers to, numbered; the others are left out."""
    used = dict.fromkeys(re.findall(r'(?:href="|url\()#([^")]+)', text))
    names = {name: f"i{number}" for number, name in enumerate(used, 1)}

    def own(match: re.Match[str]) -> str:
        return f' id="{names[match[1]]}"' if match[1] in names else ""

    text = re.sub(r' id="([^"]*)"', own, text)
    return re.sub(r'((?:href="|url\()#)([^")]+)', lambda m: m[1] + names[m[2]], text)
