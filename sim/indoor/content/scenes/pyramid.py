"""`indoor-pyramid`: a hall with a slanted side, a triangular island and a long slanted one.

Cyan floor, red mottled ceiling, yellow and green brick; light as of a swimming bath.
"""

from sim.indoor.content import furniture as make
from sim.indoor.content.patterns import artwork, leaves, stripes
from sim.indoor.content.plan import Plan
from sim.indoor.content.textures import brick, plain, plaster, rubble, tiles


def draw() -> Plan:
    plan = Plan(height=3.4, exposure=1.6)
    yellow = brick("#d9a93a", "#c9952c", "#e5bb55", mortar="#8a6420", columns=4, rows=12, seed=1)
    gold = brick(
        "#a8742c", "#8f5f24", "#c08a3c", "#6f4a1e", mortar="#e0c080", columns=5, rows=18, seed=2
    )
    green = brick(
        "#66704a", "#7f8a5c", "#50593c", "#939c70", mortar="#d8d4b0", columns=4, rows=10, seed=3
    )
    concrete = plaster("#c9c7c0", grain=0.09, metres=4.0, seed=4)
    azure = brick(
        "#2f86b8", "#3f9aca", "#e8f1f4", "#256c98", mortar="#d8e8ee", columns=3, rows=12, seed=5
    )
    scarlet = plaster("#b3121c", grain=0.06, seed=6)
    water = tiles("#37c8dc", "#2fbcd2", joint="#b8f0f4", count=3, width=0.03, metres=2.4, seed=7)
    ceiling = rubble("#a01c14", "#b82a1c", "#861410", "#c23a28", mortar="#7a120c", stones=9, seed=8)

    plan.room(
        [(0, 0), (16, 0), (36, 20), (36, 30), (0, 30)],
        floor=water,
        ceiling=ceiling,
        walls=[green, gold, concrete, azure, yellow],
    )
    plan.island([(5, 25), (5, 15), (15, 25)], walls=[yellow, green, scarlet])
    plan.island(
        [(5, 5), (14, 5), (30, 21), (26, 25), (10, 9), (5, 9)],
        walls=[gold, yellow, azure, green, concrete, yellow],
    )

    plan.put(make.plant(seed=1, height=1.7), (35.2, 29.2))
    plan.put(make.sofa(plain("#3d4a38")), (35.4, 24.0), 270)
    plan.put(make.table(width=1.0, height=0.45), (34.2, 24.0), 90)
    plan.put(make.chair(), (31.0, 29.4), 180)
    plan.put(make.cabinet(plain("#f4f4f0"), width=1.8), (20, 29.7), 180)
    plan.put(make.shelf(width=1.4, material=make.OAK, seed=5), (0.2, 8), 90)
    plan.put(make.shelf(width=1.4, material=make.OAK, seed=6), (0.2, 9.6), 90)
    plan.put(make.bench(make.WALNUT, 2.0), (0.4, 20), 90)
    plan.put(make.sofa(plain("#c8c4b8"), width=1.6), (8, 29.4), 180)
    plan.put(make.barrel(plain("#e0e4e8")), (0.6, 29.3))
    plan.put(make.barrel(stripes("#d8b020", "#202020", slant=3)), (0.7, 0.7))
    plan.put(make.crate(make.OAK, 0.7), (9, 0.6), 8)
    plan.put(make.crate(make.WALNUT, 0.5), (9.8, 0.5), 40)
    plan.put(make.wastebasket(plain("#e8e8e8")), (17.0, 8.5), 0)
    plan.put(make.globe(leaves("#58a848"), 0.4), (21.0, 5.9))
    plan.put(make.desk(plain("#bfe6ff", glow=0.6), make.WALNUT), (28.4, 13.7), 315)
    plan.put(
        make.picture(artwork("#f4f0e0", "#c02018", "#1a8098", seed=21), 1.8, 1.1), (4.97, 20), 270
    )
    plan.put(
        make.picture(artwork("#102030", "#30c0d0", "#f0f0f0", seed=22), 1.8, 1.1), (9.5, 4.97), 180
    )
    plan.put(make.picture(artwork("#e0d8b0", "#905020", "#306040", seed=23)), (35.97, 22), 270)
    plan.put(make.door(plain("#f0f0ec")), (26, 30), 180)
    plan.put(make.plant(seed=5), (12.6, 5.0 - 0.4), 0)
    plan.put(make.stairs(plain("#d8d8d2"), steps=4), (14, 28.9), 180)
    plan.put(make.floor_lamp(), (0.7, 13.0))
    plan.glow(0.7, 13.0, 1.6, "#ffdca0", 1.0)

    for x, y in [(2.5, 2.5), (9, 2.5), (2.5, 9), (2.5, 15), (2.5, 21), (2.5, 27.5), (9, 27.5),
                 (16, 27.5), (23, 27.5), (30, 28), (33, 24), (33, 19.5), (8, 13), (13, 17),
                 (18, 21.5), (16.5, 4), (22, 9.5), (27.5, 15)]:  # fmt: skip
        plan.lamp(x, y, "#fbf6ff", power=2.7)

    for x, y, heading in [(2.5, 4, 0), (2.5, 17, 0), (4, 27.5, 90), (18, 27.5, 90), (33, 27, 180),
                          (29, 16.5, 225), (19, 6.5, 45), (9, 2.5, 270), (9.5, 14, 45),
                          (20, 23.5, 225)]:  # fmt: skip
        plan.start(x, y, heading)
    for x, y, heading in [
        (2.2, 4.2, 6),
        (4.0, 28.6, 112),
        (29.5, 27.6, 118),
        (18.5, 4.6, 35),
        (15.5, 18.5, 225),
    ]:
        plan.view(x, y, heading)
    return plan
