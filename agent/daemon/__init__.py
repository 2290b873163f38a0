"""One agent as a process: its rounds, what it answers, how it joins."""
