"""`indoor-vanleer`: the corridors of a university building, never trained on.

Grey carpet, white ceiling tiles, cream walls with a blue band of doors and notice boards.
"""

from sim.indoor.content import furniture as make
from sim.indoor.content.patterns import artwork
from sim.indoor.content.plan import Opening, Plan
from sim.indoor.content.textures import brick, plain, plaster, tiles, wood


def draw() -> Plan:
    plan = Plan(height=3.0, exposure=1.5)
    cream = plaster("#ece6d6", grain=0.025, seed=1)
    blue = plaster("#7f9cc0", grain=0.03, seed=2)
    block = brick(
        "#d9d5ca", "#d0ccc0", "#e2dfd5", mortar="#b5b1a5", columns=4, rows=10, rough=0.4, seed=3
    )
    clinker = brick("#8d4a38", "#7a3e30", "#9d5a46", mortar="#b9b0a6", columns=6, rows=20, seed=4)
    carpet = plaster("#6f747c", grain=0.12, metres=2.0, seed=5)
    lobby = tiles("#d8cdb8", "#a88f70", joint="#8a7a62", count=4, width=0.02, seed=6)
    ceiling = tiles("#f2f2ee", joint="#c9c9c4", count=3, width=0.03, gloss=0.0, metres=1.8, seed=7)

    plan.room(
        [(0, 0), (30, 0), (30, 6), (46, 6), (46, 24), (18, 24), (18, 20), (0, 20)],
        floor=carpet,
        ceiling=ceiling,
        walls=[cream, clinker, block, blue, cream, clinker, cream, block],
    )
    plan.carpet([(30.5, 10.6), (46, 10.6), (46, 19.4), (30.5, 19.4)], lobby)
    plan.island([(4.4, 4.4), (14, 4.4), (14, 15.6), (4.4, 15.6)], walls=[blue, cream, block, cream])
    plan.island(
        [(18.4, 4.4), (25.6, 4.4), (25.6, 15.6), (18.4, 15.6)], walls=[cream, clinker, cream]
    )
    plan.island([(30.2, 10.5), (36, 10.5), (36, 19.4), (30.2, 19.4)], walls=[block, blue])
    plan.island([(40.6, 10.5), (41.6, 10.5), (41.6, 19.4), (40.6, 19.4)], walls=clinker)
    plan.wall((14, 10), (18.4, 10), blue, openings=[Opening(2.2, 3.4, top=2.6)])

    beech = wood("#c89a5f", seed=8)
    for x in (3.0, 9.0, 22.0):
        plan.put(make.door(beech), (x, 0.0), 0)
    for x in (6.0, 12.0):
        plan.put(make.door(beech), (x, 4.4), 180)
        plan.put(make.door(beech), (x, 15.6), 0)
    for along in (6, 12):
        plan.put(make.door(beech), (0.0, along), 90)
    plan.put(make.door(beech), (24, 24), 180)
    plan.put(make.door(beech), (46, 21), 270)
    cork = artwork("#b98d58", "#f4f4f4", "#f0e070", "#a0c8e8", "#e8a0a0", seed=31)
    for at, heading in [((4.37, 9), 270), ((14.03, 8), 90), ((18.37, 13), 270), ((36.03, 15), 90),
                        ((33, 10.47), 180), ((0.02, 15), 90)]:  # fmt: skip
        plan.put(make.picture(cork, 1.8, 1.0, frame=make.METAL), at, heading)
    plan.put(make.bench(beech, 2.0), (25.9, 10), 90)
    plan.put(make.wastebasket(plain("#2f5fa8")), (29.6, 0.5))
    plan.put(make.wastebasket(plain("#3f8f4a")), (29.1, 0.45))
    plan.put(make.cabinet(plain("#9aa3ad"), 1.6, 1.3), (16.2, 19.7), 180)
    plan.put(make.cabinet(plain("#9aa3ad"), 1.6, 1.3), (2.2, 19.7), 180)
    plan.put(make.plant(seed=13, height=1.6, pot=plain("#f0f0f0")), (18.6, 23.4))
    plan.put(make.plant(seed=14, height=1.6, pot=plain("#f0f0f0")), (45.4, 6.6))
    plan.put(make.sofa(plain("#2f4f7f"), 2.2), (45.4, 12), 270)
    plan.put(make.sofa(plain("#2f4f7f"), 2.2), (45.4, 16.5), 270)
    plan.put(make.table(1.0, 0.6, 0.4, beech), (44.4, 14.2), 90)
    plan.put(make.desk(plain("#cfe6ff", glow=0.6), beech), (21.0, 16.1), 0)
    plan.put(make.stairs(plain("#b9b4aa"), steps=4), (38.5, 7.2), 180)

    tube = "#f4f8ff"
    for x, y in [(2.2, 2.2), (9, 2.2), (16.2, 2.2), (22, 2.2), (27.8, 2.2), (2.2, 10), (2.2, 17.8),
                 (9, 17.8), (16.2, 17.8), (16.2, 7), (16.2, 13), (27.9, 8), (27.9, 14), (22, 19.8),
                 (28, 21.7), (34, 21.7), (43.8, 21.7), (38.3, 21.7), (38.3, 15), (43.8, 15),
                 (34, 8.2), (40, 8.2)]:  # fmt: skip
        plan.lamp(x, y, tube, power=2.1)

    for x, y, heading in [(4, 2.2, 90), (20, 2.2, 270), (27.9, 5, 0), (2.2, 8, 0), (6, 17.8, 90),
                          (16.2, 13, 180), (27.9, 14, 180), (30, 21.7, 90), (38.3, 14, 0),
                          (34, 8.2, 270), (44, 20, 180)]:  # fmt: skip
        plan.start(x, y, heading)
    for x, y, heading in [
        (15.5, 2.0, 285),
        (27.6, 1.2, 350),
        (42.3, 19.6, 150),
        (2.5, 16.6, 95),
        (33.8, 8.6, 95),
    ]:
        plan.view(x, y, heading)
    return plan
