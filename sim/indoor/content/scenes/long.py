"""`indoor-long`: a hall with one loop, a long corridor, a hall with two loops.

Beige plaster and light wood, green stone, a warm and even light; pale green floor on the left,
brown parquet on the right.
"""

from sim.indoor.content import furniture as make
from sim.indoor.content.patterns import artwork
from sim.indoor.content.plan import Opening, Plan
from sim.indoor.content.textures import brick, plain, planks, plaster, tiles


def draw() -> Plan:
    plan = Plan(height=3.2, exposure=1.15)
    beige = plaster("#e9d7a8", seed=1)
    boards = planks("#e2c48c", "#b08a54", columns=1, rows=4, contrast=0.05, metres=3.0, seed=2)
    green = brick("#1f6a63", "#2f8577", "#174f52", "#cfe0d6", mortar="#123a3a", columns=3, rows=14)
    ochre = brick("#c98f45", "#b67b36", "#d9a45c", mortar="#efe3c8", columns=5, rows=16, seed=4)
    parquet = planks("#8a5a37", "#4a2d1a", columns=4, rows=12, seed=5)
    mint = tiles("#dfe9c2", "#d3e0b4", joint="#a9b98d", count=4, seed=6)
    pavers = brick("#efe3d0", "#e4d3bd", "#f4ebdc", mortar="#c9b8a2", columns=4, rows=8, seed=7)
    ceiling = plaster("#d8c48e", grain=0.02, seed=8)

    plan.room(
        [(0, 0), (13, 0), (13, 11.5), (38, 11.5), (38, -3), (60, -8), (60, 8), (49, 16), (0, 16)],
        floor=pavers,
        ceiling=ceiling,
        walls=[ochre, beige, boards, beige, green, ochre, green, boards, beige],
    )
    plan.carpet([(0, 0), (13, 0), (13, 16), (0, 16)], mint)
    plan.carpet([(38, -3), (60, -8), (60, 8), (49, 16), (38, 16)], parquet)
    plan.island([(4.5, 4.6), (8.5, 4.6), (8.5, 11.4), (4.5, 11.4)], walls=[green, boards])
    plan.island([(42.4, 0.6), (46.4, -0.3), (46.4, 11.4), (42.4, 11.4)], walls=[beige, ochre])
    plan.island([(51, -1.3), (55.5, -2.3), (55.5, 5.6), (51, 8.8)], walls=[green, beige])
    for x in (13.1, 38):  # the corridor's two gates
        plan.wall((x, 11.5), (x, 16), boards, openings=[Opening(2.25, 3.5, top=2.8)])

    # the left hall: a reading room
    red = plain("#a03c2e")
    plan.put(make.sofa(red, cushion=plain("#e8c9a0")), (1.0, 7.6), 90)
    plan.put(make.shelf(width=1.6), (0.2, 11.0), 90)
    plan.put(make.plant(seed=1), (0.6, 15.3))
    plan.put(make.table(), (2.0, 0.8))
    plan.put(make.chair(), (2.0, 1.4), 180)
    plan.put(
        make.picture(artwork("#e9e2cf", "#205a52", "#d98a3a", "#7a2f2a", seed=3)), (8.53, 8), 90
    )
    plan.put(make.picture(width=1.8), (6.5, 4.57), 180)
    plan.put(make.cabinet(make.OAK), (12.7, 4.0), 270)
    plan.put(make.floor_lamp(), (12.5, 1.0))
    plan.glow(12.5, 1.0, 1.5, "#ffdca0", 1.0)

    # the corridor
    plan.put(make.bicycle(), (18.0, 11.85), 0)
    plan.put(make.wastebasket(), (21.0, 15.6))
    plan.put(make.bench(), (25.0, 15.7), 180)
    plan.put(
        make.picture(artwork("#123a3a", "#e0c070", "#c05030", "#f2eee2", seed=9)), (28, 15.98), 180
    )
    plan.put(
        make.picture(artwork("#f2eee2", "#c05030", "#274690", "#123a3a", seed=8)), (22, 11.52), 0
    )
    plan.put(make.plant(seed=4), (33.0, 11.95))
    plan.put(make.door(make.WALNUT), (30.0, 11.5), 0)
    plan.put(make.door(make.WALNUT), (16.5, 16.0), 180)

    # the right hall: workshop and office
    plan.put(make.desk(plain("#8fc4e8", glow=0.6)), (39.1, 3.0), 90)
    plan.put(make.shelf(width=1.4, seed=2), (38.2, 7.5), 90)
    plan.put(make.crate(make.OAK), (46.9, 4.0), 10)
    plan.put(make.crate(make.WALNUT, 0.5), (46.8, 4.8), 40)
    plan.put(make.cabinet(make.WALNUT, width=1.8), (50.7, 4.0), 270)
    plan.put(make.bench(), (59.6, 0), 270)
    plan.put(make.plant(seed=6), (59.3, -6.8))
    plan.put(make.barrel(plain("#2f6f8f")), (56.0, 3.8))
    plan.put(make.sofa(plain("#3c5a4a")), (43.2, 15.4), 180)
    plan.put(make.table(height=0.5, width=1.0), (43.3, 14.2))
    plan.put(make.picture(artwork("#f4ebdc", "#174f52", "#c98f45", seed=5)), (46.43, 7), 90)
    plan.put(make.picture(artwork("#2b2b2b", "#e0e0e0", "#c9a040", seed=6)), (42.37, 5), 270)

    for x, y in [(2.2, 2.3), (10.7, 2.3), (2.2, 13.7), (10.7, 13.7), (2.2, 8), (10.7, 8)]:
        plan.lamp(x, y)
    for x in (17, 22, 27, 32, 37):
        plan.lamp(x, 13.7, power=2.6)
    for x, y in [(40.2, 13.7), (45, 13.8), (40.2, 8), (40.2, 2), (43, -1.6), (48.7, -3),
                 (48.7, 3), (48.7, 9), (54, -4.8), (57.8, -2.5), (57.8, 4),
                 (54, 9.5), (49, 13.5)]:  # fmt: skip
        plan.lamp(x, y, "#ffe9c4")

    for x, y, heading in [(2.3, 4, 0), (6.5, 13.7, 90), (10.7, 9, 180), (15.5, 13.7, 90),
                          (24, 13.8, 270), (35, 13.7, 90), (40.3, 9, 180), (48.8, 0, 0),
                          (57.7, -3, 0), (53, 11, 315)]:  # fmt: skip
        plan.start(x, y, heading)
    for x, y, heading in [
        (10.4, 12.9, 235),
        (12.2, 13.9, 85),
        (26, 13.7, 275),
        (39.4, -0.6, 14),
        (52.5, 10.2, 292),
    ]:
        plan.view(x, y, heading)
    return plan
