"""What observers see: telemetry and history."""
