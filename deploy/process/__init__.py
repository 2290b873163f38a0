"""What every command of ours does as a process: signals, logs, ending what it started."""
