"""`indoor-techno`: a machine hall of four blocks, never trained on.

Dark plates with lit slots, a grated floor, violet and cyan neon; lower and darker than the others.
"""

from sim.indoor.content import furniture as make
from sim.indoor.content.patterns import panels, stripes
from sim.indoor.content.plan import Plan
from sim.indoor.content.textures import plain, plaster, tiles


def draw() -> Plan:
    plan = Plan(height=2.9, exposure=2.6)
    plates = panels("#3c4858", "#10161e", "#46e6ff", seed=1)
    violet = panels("#433a58", "#140f1e", "#d060ff", seed=2)
    steel = panels("#707a84", "#2a3036", "#b8f060", count=4, seed=3)
    grate = tiles("#2b3038", "#343a44", joint="#0c0e12", count=8, width=0.10, metres=2.0, seed=4)
    rubber = plaster("#23262b", grain=0.05, seed=5)
    ceiling = tiles("#242a33", joint="#3a4452", count=3, width=0.05, metres=2.0, seed=6)
    hazard = stripes("#16171a", "#e0b020", count=3, slant=3, metres=1.0)

    plan.room(
        [(4, 0), (36, 0), (40, 4), (40, 22), (36, 26), (4, 26), (0, 22), (0, 4)],
        floor=rubber,
        ceiling=ceiling,
        walls=[plates, hazard, violet, hazard, steel, hazard, plates, hazard],
    )
    plan.carpet([(4.8, 10.8), (35.2, 10.8), (35.2, 15.2), (4.8, 15.2)], grate)
    blocks = [
        ([(6, 5), (17.5, 5), (17.5, 10.5), (5, 10.5), (5, 6)], [steel, violet, plates]),
        ([(22.5, 5), (34, 5), (35, 6), (35, 10.5), (22.5, 10.5)], [violet, steel, plates]),
        ([(5, 15.5), (17.5, 15.5), (17.5, 21), (6, 21), (5, 20)], [plates, violet, steel]),
        ([(22.5, 15.5), (35, 15.5), (35, 20), (34, 21), (22.5, 21)], [steel, plates, violet]),
    ]
    for outline, walls in blocks:
        plan.island(outline, walls=walls)
    plan.canopy([(17.5, 10.5), (22.5, 10.5), (22.5, 15.5), (17.5, 15.5)], ceiling, drop=0.25)

    screen = panels("#0c1218", "#04060a", "#60ff90", count=6, seed=7)
    for x in (9, 9.8, 10.6):
        plan.put(make.rack(make.BLACK, screen), (x, 0.5), 0)
    for x in (27, 27.8):
        plan.put(make.rack(make.BLACK, screen), (x, 25.5), 180)
    plan.put(make.desk(plain("#70e0ff", glow=0.9), make.METAL), (39.3, 9.0), 270)
    plan.put(make.barrel(plain("#c8a018")), (39.4, 17.0))
    plan.put(make.barrel(plain("#2a7f9f")), (39.3, 17.8))
    plan.put(make.crate(hazard, 0.7), (0.5, 14.5), 5)
    plan.put(make.crate(make.METAL, 0.5), (0.5, 15.4), 20)
    plan.put(make.cabinet(make.METAL, width=2.0, height=1.1), (14.0, 25.7), 180)
    plan.put(make.bench(make.METAL), (22.1, 18), 270)
    plan.put(make.wastebasket(make.METAL), (18.0, 7.0))
    plan.put(make.stairs(make.METAL, steps=4), (30, 1.2), 180)
    plan.put(make.chair(make.METAL, plain("#c02060")), (18.0, 19.5), 90)
    plan.put(make.plant(seed=11, height=1.2, pot=plain("#e8e8e8")), (39.2, 21.2))

    cyan, violet_tone, white = "#7fe8ff", "#d59bff", "#dbe8ff"
    for k, (x, y) in enumerate(
        [(8, 2.4), (15, 2.4), (25, 2.4), (32, 2.4), (37.5, 8), (37.5, 18), (32, 23.6), (25, 23.6),
         (15, 23.6), (8, 23.6), (2.5, 18), (2.5, 8), (9, 13), (31, 13), (20, 7.5), (20, 18.5)]
    ):  # fmt: skip
        plan.lamp(x, y, (cyan, white, violet_tone)[k % 3], power=3.2)
    plan.lamp(20, 13, white, power=2.6, drop=0.5)

    for x, y, heading in [(7, 2.5, 90), (20, 2.6, 90), (37.4, 6, 0), (37.4, 20, 0), (24, 23.4, 270),
                          (6, 23.4, 270), (2.6, 20, 180), (2.6, 8, 180), (8, 13, 90),
                          (32, 13, 270), (20, 9, 0)]:  # fmt: skip
        plan.start(x, y, heading)
    for x, y, heading in [
        (12.6, 3.4, 285),
        (37.2, 4.6, 8),
        (37, 22, 250),
        (8, 13, 90),
        (3, 20.5, 165),
    ]:
        plan.view(x, y, heading)
    return plan
