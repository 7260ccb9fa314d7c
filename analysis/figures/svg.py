"""Smaller SVG: what matplotlib writes, in fewer bytes and looking the same.

Of the suite ``comparison`` the figures of a report take 2.1 MB, in the page and in files, instead
of 6.0 MB; with nothing but rounded coordinates they would take 4.4 MB.
"""

from __future__ import annotations

import re

_FINE, _COARSE, _MANY = 100, 10, 120
"""Coordinates are whole multiples of 1/100 pt, of curves with many numbers 1/10 pt."""
_COMMAND = re.compile(r"([MLQCz])([^MLQCz]*)")
_DIGITS = re.compile(r"-?\d+\.\d{3,}")
_DRAWN = re.compile(r"<(?:use|text)\b[^>]*>")


def compact(text: str) -> str:
    """The SVG of a figure with short ids, relative paths and without idle groups.

    Nothing moves by more than half a step of coordinates. Text that is text gets its family
    from the root.
    """
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
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
    steps = _FINE if len(path.split()) <= _MANY else _COARSE
    at = start = (0, 0)
    pieces: list[tuple[str, list[int]]] = []
    for command, text in _COMMAND.findall(path):
        numbers = [round(float(number) * steps) for number in text.split()]
        moved = [number - at[k % 2] for k, number in enumerate(numbers)]
        if command == "L" and pieces[-1][0] == "l" and _ahead(pieces[-1][1], moved):
            pieces[-1] = ("l", [sum(both) for both in zip(pieces[-1][1], moved, strict=True)])
        else:
            pieces.append((command.lower() if pieces else "M", moved))
        at = (numbers[-2], numbers[-1]) if numbers else start
        if command == "M":
            start = at
    out = last = ""
    for command, moved in pieces:
        if command == "l":
            if not any(moved):
                continue
            if not all(moved):  # along an axis
                command, moved = ("h", moved[:1]) if moved[0] else ("v", moved[1:])
        words = " ".join(_decimal(number, steps) for number in moved)
        if command == last and command not in "mz":  # said once for several
            out += f" {words}"
        else:
            out += command + words
        last = command
    return out.replace(" -", "-")  # a minus separates as well


def _ahead(stretch: list[int], step: list[int]) -> bool:
    """Whether a step goes on in the direction of a straight stretch, exactly."""
    (x, y), (right, up) = stretch, step
    return x * up == y * right and x * right + y * up >= 0


def _decimal(number: int, steps: int = _FINE) -> str:
    """So many steps without idle zeros."""
    return re.sub(r"^(-?)0(?=\.)", r"\1", f"{number / steps:.9g}")


def _rounded(match: re.Match[str]) -> str:
    """A drawn element with its place rounded, and not turned by nothing."""
    tag = re.sub(r' transform="rotate\(-?0 [^"]*\)"', "", match[0])
    # A letter of a word that is drawn as paths.
    tag = re.sub(r' transform="translate\((\S+) 0\)"', r' x="\1"', tag)
    places = r'( (?:x|y|transform)=")([^"]*)'

    def short(number: re.Match[str]) -> str:
        return _decimal(round(float(number[0]) * _FINE))

    return re.sub(places, lambda m: m[1] + _DIGITS.sub(short, m[2]), tag)


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
