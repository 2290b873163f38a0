"""What becomes of a mistake: one line on standard error, and an exit code.

Interface: :func:`one_line` around a whole command, :func:`plain_errors` around what speaks in the
standard library's exceptions.  What is none of the user's doing keeps its traceback.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from deploy.process.packages import needs
from deploy.process.signals import StoppedError
from swarm.errors import ConfigError, SwarmError


@contextmanager
def one_line() -> Iterator[None]:
    """Tell a mistake in one line and end the process with its exit code."""
    try:
        yield
    except StoppedError:
        _end("stopped", 130)
    except SwarmError as error:
        _end(str(error), error.exit_code)
    except typer.TyperException as error:  # an option or argument that there is not, or not so
        message, context = error.format_message(), getattr(error, "ctx", None)
        if message.startswith("Usage:"):  # nothing was asked for: the help is the answer
            print(message, file=sys.stderr)
            sys.exit(error.exit_code)
        see = f" (see {context.command_path} --help)" if context is not None else ""
        _end(f"{message.rstrip('.')}{see}", error.exit_code)
    except typer.Abort:
        _end("stopped", 130)
    except ModuleNotFoundError as error:
        if (told := needs(error.name or "")) is None:
            raise
        _end(told, ConfigError.exit_code)
    except OSError as error:
        if error.filename is None:
            raise
        _end(f'"{error.filename}": {error.strerror}', 1)


@contextmanager
def plain_errors() -> Iterator[None]:
    """The worlds and the vehicle raise the standard library's exceptions; a user sees one line."""
    try:
        yield
    except ModuleNotFoundError:
        raise
    except (ValueError, OSError, ImportError) as error:
        raise ConfigError(str(error)) from None


def _end(message: str, code: int) -> None:
    print(f"swarm: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(code)
