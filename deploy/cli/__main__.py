"""The program ``swarm``, also ``python -m deploy.cli``.

Signals come first: the imports behind the command line take a second or two.
"""

from deploy.process.signals import end_at_signals


def main() -> None:
    """Entry point."""
    end_at_signals()
    from deploy.cli.main import main as run  # noqa: PLC0415

    run()


if __name__ == "__main__":
    main()
