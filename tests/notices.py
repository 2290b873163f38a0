"""What a slow machine says while it works is no answer and no mistake."""

from sim.notices import MARK


def without_notices(text: str) -> str:
    """The text without the lines that announce what goes on."""
    return "".join(line for line in text.splitlines(True) if not line.startswith(MARK))
