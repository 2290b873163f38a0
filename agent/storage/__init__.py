"""What an agent keeps on disk: checkpoints and the run folder."""
