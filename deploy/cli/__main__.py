"""``python -m deploy.cli``: the command ``swarm`` without its script."""

from deploy.cli.main import main

main()
