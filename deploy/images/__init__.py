"""What machines need to run agents: images, compose file, systemd unit, certificates."""
