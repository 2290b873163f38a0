"""What a study claims, and how it is kept: terminal table, Markdown, JSON.

A :class:`Study` is a function from :class:`Options` to :class:`Findings`.  :func:`publish` prints
the findings, and writes them beside the study's figure under the output folder.
"""

import platform
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

import msgspec
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from agent.storage.files import write_file


class Claim(msgspec.Struct, frozen=True):
    """One line of a study's table.

    Attributes:
        what: the quantity and where it is.
        paper: what the print says ("" where it is silent).
        corrected: the corrected formula's value, or what is required here; "" for a mere
            observation.
        ours: what came out.
        holds: whether ours agrees with ``corrected``; true of an observation.
    """

    what: str
    paper: str
    corrected: str
    ours: str
    holds: bool

    @property
    def mark(self) -> str:
        """What stands at the end of its line."""
        return ("✔" if self.holds else "✘") if self.corrected else ""


class Say(Protocol):
    """Takes what is being done, and the share of all that is done."""

    def __call__(self, detail: str, done: float | None = None, /) -> None: ...


@dataclass(frozen=True)
class Options:
    """How a study is run.

    Attributes:
        out: folder for what it writes.
        seeds: number of independent repetitions.
        quick: shorter and coarser: shows that everything works, proves less.
        say: tells the user what it is at, and the share of all that is done, if that is known.
    """

    out: Path
    seeds: int
    quick: bool
    say: Say


class Findings(msgspec.Struct):
    """What a study found.

    Attributes:
        title: of the table.
        claims: its lines.
        notes: sentences to read with it.
        data: numbers behind table and figure, for JSON.
        figures: files written.
    """

    title: str
    claims: list[Claim]
    notes: list[str]
    data: dict[str, Any]
    figures: list[Path]


Study = Callable[[Options], Findings]


def close(what: str, paper: float | str, formula: float, ours: float, within: float) -> Claim:
    """The claim that our value is the formula's, to an absolute error."""
    printed = paper if isinstance(paper, str) else f"{paper:.6f}"
    error = abs(ours - formula)
    return Claim(what, printed, f"{formula:.6f}", f"{ours:.6f} ± {error:.0e}", error <= within)


def bounded(
    what: str, ours: float, low: float | None = None, high: float | None = None, paper: str = ""
) -> Claim:
    """The claim that our value lies between two numbers."""
    limits = [f">= {low:g}" if low is not None else "", f"<= {high:g}" if high is not None else ""]
    required = ", ".join(filter(None, limits))
    holds = (low is None or ours >= low) and (high is None or ours <= high)
    return Claim(what, paper, required, f"{ours:.3f}", bool(holds))


def at_most(what: str, ours: float, limit: float, paper: str = "") -> Claim:
    """The claim that our value is no larger than a bound; both may span many magnitudes."""
    return Claim(what, paper, f"<= {limit:.3g}", f"{ours:.3g}", bool(ours <= limit))


def noted(claim: Claim) -> Claim:
    """The claim as a mere observation, where a shorter study cannot be expected to keep it."""
    return msgspec.structs.replace(claim, corrected="", holds=True)


def publish(name: str, study: Study, options: Options, as_json: bool, console: Console) -> bool:
    """Run a study, print and keep what it found.

    Returns:
        Whether all of its claims hold.
    """
    options.out.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    findings = study(options)
    made = provenance(options, time.perf_counter() - start)
    record = {"study": name, "title": findings.title, "made": made, "claims": findings.claims}
    record |= {"notes": findings.notes, "figures": [file.name for file in findings.figures]}
    encoded = msgspec.json.encode(record | {"data": findings.data}, enc_hook=_plain)
    text = msgspec.json.format(encoded, indent=1)
    write_file(options.out / f"{name}.json", text)
    write_file(options.out / f"{name}.md", markdown(findings, made).encode())
    if as_json:
        print(text.decode())
    else:
        console.print(_table(findings))
        for note in findings.notes:
            console.print(escape(note))
        console.print(f"{made['seconds']:.0f} s; table, numbers and figure in {options.out}/")
    return all(claim.holds for claim in findings.claims)


def _plain(value: Any) -> Any:
    """NumPy's arrays and scalars as JSON's."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")


HEADINGS = ("", "paper", "corrected / required", "here", "")


def _table(findings: Findings) -> Table:
    table = Table(title=findings.title)
    for heading in HEADINGS:
        table.add_column(heading)
    for c in findings.claims:
        mark = f"[{'green' if c.holds else 'red'}]{c.mark}[/]"
        table.add_row(*map(escape, (c.what, c.paper, c.corrected, c.ours)), mark)
    return table


def markdown(findings: Findings, made: dict[str, Any]) -> str:
    """The findings as a page."""
    lines = [f"# {findings.title}", ""]
    lines += [f"![{file.stem}]({file.name})" for file in findings.figures]
    lines += ["", "| " + " | ".join(HEADINGS) + " |", "| --- " * len(HEADINGS) + "|"]
    for c in findings.claims:
        cells = [c.what, c.paper, c.corrected, c.ours, c.mark]
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    lines += ["", *(f"- {note}" for note in findings.notes), ""]
    lines.append(", ".join(f"{key} {value}" for key, value in made.items() if value is not None))
    return "\n".join(lines) + "\n"


def provenance(options: Options, seconds: float) -> dict[str, Any]:
    """Where these numbers come from."""
    made: dict[str, Any] = {
        "seeds": options.seeds,
        "quick": options.quick,
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "commit": _commit(),
        "machine": f"{platform.machine()} {platform.system()}, Python {platform.python_version()}",
        "seconds": round(seconds, 1),
    }
    for package in ("dcpg-swarm", "numpy"):
        try:
            made[package] = version(package)
        except PackageNotFoundError:
            continue
    return made


def _commit() -> str | None:
    """The commit of the source tree that runs, with a + if there are changes; None outside git."""
    source = Path(__file__).parent
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty=+", "--exclude=*"],
            cwd=source, capture_output=True, text=True, timeout=10, check=True,
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
