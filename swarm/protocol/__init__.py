"""Who is awaited, who is believed, and what the ends of an edge agree on."""
