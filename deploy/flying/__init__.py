"""Single drones: pilots, flights through worlds and with vehicles, contact sheets."""
