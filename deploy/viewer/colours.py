"""Colours that nobody confuses (Okabe and Ito 2008); an agent has the same one in every view."""

Colour = tuple[int, int, int]

AGENTS: tuple[Colour, ...] = (
    (86, 180, 233),  # sky blue
    (230, 159, 0),  # orange
    (204, 121, 167),  # reddish purple
    (240, 228, 66),  # yellow
    (0, 114, 178),  # blue
    (220, 220, 220),  # light grey
)  # a seventh begins again; names stand beside them
GOAL: Colour = (0, 158, 115)  # bluish green
TROUBLE: Colour = (213, 94, 0)  # vermilion: obstacles, missing edges, warnings
FREE: Colour = (38, 42, 48)
START: Colour = (110, 116, 124)
LINES: Colour = (20, 22, 25)
ABSENT: Colour = (90, 90, 90)


def of_agent(place: int) -> Colour:
    """Colour of the agent at this place of the swarm file."""
    return AGENTS[place % len(AGENTS)]
