"""What a world consists of: plans, furniture, textures, user files, the scenes by name."""
