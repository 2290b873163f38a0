"""How parameters and reports travel over Zenoh: keys, payload, session, security."""
