"""The command line ``swarm``: one page of arguments for each group of commands."""
