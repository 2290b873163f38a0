"""Everything that starts, stops, watches or reproduces: command line, launcher, viewer, reports."""
