"""The commands of a Markdown page, and what is run in place of those that take long.

A block of commands is run as it stands, or, where a comment ``<!-- test ... -->`` stands directly
above it, as the comment says; rendered pages do not show comments.  The kinds of blocks:

*   ```` ```sh ````: a shell script.  Its comment is one, too, to be run instead.
*   ```` ```python ````: a program; its comment is a shell script, too.
*   ```` ```toml ````: must be TOML.
*   ```` ```text ````: output or a drawing; nothing is run.
*   a table whose first column holds commands in backticks: its comment has to run each of them.

``<!-- file: NAME -->`` above a block writes it into the scratch copy, for what follows on the page.
Anything else, an indented block included, is a mistake of the page.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Kind = Literal["sh", "python", "toml", "text", "table"]
KINDS = ("sh", "python", "toml", "text")
_COMMENT = re.compile(r"<!-- (test|file):?\s+(.*?)\s*-->\Z", re.DOTALL)
_COMMAND = re.compile(r"\| `((?:swarm|make|docker|pip|python) ?[a-z]*)")


class PageError(Exception):
    """A page has a block that nobody can test."""


@dataclass(frozen=True)
class Block:
    """One block of a page.

    Attributes:
        page: its file.
        line: where it begins, from 1.
        kind: what it holds.
        text: of the block.
        test: what its comment wants run instead, or "".
        file: name under which it is kept, or "".
    """

    page: Path
    line: int
    kind: Kind
    text: str
    test: str
    file: str

    @property
    def place(self) -> str:
        """For messages."""
        return f"{self.page.name}:{self.line}"


def blocks_of(page: Path) -> list[Block]:
    """All blocks of a page, in order.

    Raises:
        PageError: one of them is of no known kind, or cannot be run as it stands.
    """
    lines, found, comment = page.read_text(encoding="utf-8").splitlines(), list[Block](), ""
    at = 0
    while at < len(lines):
        line, begin = lines[at], at
        if line.startswith("<!--"):
            while "-->" not in lines[at]:
                at += 1
            comment = "\n".join(lines[begin : at + 1])
            at += 1
            continue
        if line.startswith("```"):
            at += 1
            while lines[at] != "```":
                at += 1
            text = "\n".join(lines[begin + 1 : at])
            found.append(_block(page, begin + 1, line.removeprefix("```"), text, comment))
        elif line.startswith("| "):
            while at + 1 < len(lines) and lines[at + 1].startswith("|"):
                at += 1
            text = "\n".join(lines[begin : at + 1])
            if comment or any(_COMMAND.match(row) for row in text.splitlines()):
                found.append(_block(page, begin + 1, "table", text, comment))
        elif line.startswith("    ") and (begin == 0 or not lines[begin - 1].strip()):
            raise PageError(f"{page.name}:{begin + 1}: an indented block: expected ```sh or such")
        elif comment:
            raise PageError(f"{page.name}:{begin + 1}: a comment directly above no block")
        comment = ""
        at += 1
    return found


def _block(page: Path, line: int, kind: str, text: str, comment: str) -> Block:
    place = f"{page.name}:{line}"
    parts = _COMMENT.match(comment)
    if comment and parts is None:
        raise PageError(f"{place}: expected <!-- test ... --> or <!-- file: NAME -->")
    test = parts[2] if parts and parts[1] == "test" else ""
    file = parts[2] if parts and parts[1] == "file" else ""
    if kind == "table":
        for row in text.splitlines():
            if (command := _COMMAND.match(row)) and command[1] not in test:
                raise PageError(f"{place}: nothing above the table runs {command[1]}")
        return Block(page, line, "table", text, test, file)
    if kind not in KINDS:
        raise PageError(f'{place}: a block of "{kind}": expected one of {", ".join(KINDS)}')
    if kind == "sh" and not test and re.search(r"\bsudo\b|\bdocker\b", text):
        raise PageError(f"{place}: needs root or docker: expected a comment with what to run")
    return Block(page, line, kind, text, test, file)  # type: ignore[arg-type]
