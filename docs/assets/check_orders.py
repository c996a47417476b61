"""Check the orders of a registered study without touchbeam: python check_orders.py STUDY."""

import json
import sqlite3
import sys
import tomllib
from hashlib import sha256
from itertools import cycle, islice
from pathlib import Path

folder = Path(sys.argv[1])
first, _, body = (folder / "registration.toml").read_text(encoding="utf-8").partition("\n")
digest = sha256(body.encode()).hexdigest()
assert first == f'digest = "{digest}"', "registration.toml was changed"
study = tomllib.loads((folder / "study.toml").read_text(encoding="utf-8"))
design, conditions, own = study["design"], study["condition"], study["touch"].get("beam")
kind, repeats, n = design.get("order", "williams"), design.get("repeats", 1), len(conditions)
apart = design.get("max_alike_in_row", 2) == 1


def stream(*words):
    """Yield the bits of a stream, least significant bit of the first byte first."""
    name, number = "/".join(map(str, (seed, *words))), 0
    while True:
        block = int.from_bytes(sha256(f"{name}#{number}".encode()).digest(), "little")
        yield from ((block >> bit) & 1 for bit in range(256))
        number += 1


def below(limit, bits):
    """Return a number below `limit`, from as many bits as it takes, again until one fits."""
    while True:
        drawn = sum(next(bits) << place for place in range((limit - 1).bit_length()))
        if drawn < limit:
            return drawn


def shuffled(items, bits):
    """Return the items shuffled from the last place to the second."""
    left = list(items)
    for last in range(len(left) - 1, 0, -1):
        chosen = below(last + 1, bits)
        left[last], left[chosen] = left[chosen], left[last]
    return left


def williams():
    """Return the sequences of a Williams design: each pair follows equally often."""
    start = [(step + 1) // 2 if step % 2 else (n - step // 2) % n for step in range(n)]
    square = [[(number + row) % n for number in start] for row in range(n)]
    return square if n % 2 == 0 else square + [row[::-1] for row in square]


def ordered(session, slot):
    """Return the numbers of the conditions in their order."""
    if kind == "fixed" or n == 1:
        return list(range(n)) * repeats
    assert kind in ("williams", "blocks"), f"order {kind}: not checked here"
    square = williams() if kind == "williams" else [range(n)]
    number, mine = divmod(slot, len(square))
    words = ("cycle", number) if kind == "williams" else ("slot", slot)
    bits, blocks = stream("order", session, *range(n), *words), []
    while len(blocks) < repeats:
        if kind == "williams":
            labels = shuffled(range(n), bits)
            drawn = [[labels[number] for number in row] for row in shuffled(square, bits)]
        else:
            drawn = [shuffled(range(n), bits)]
        meet = blocks and any(
            row[-1] == after[0] for row, after in zip(blocks[-1], drawn, strict=True)
        )
        if not (apart and meet):  # otherwise the block is drawn anew
            blocks.append(drawn)
    return [number for block in blocks for number in block[mine]]


def ends(touch, backwards=False):
    """Return what a touch drives at its beginning and end, and everything else that it says."""
    pairs = (("voltage_v", "ramp_to_v", None), ("frequency", "sweep_to", 1.0))
    values = [(touch.get(a, other), touch.get(b, touch.get(a, other))) for a, b, other in pairs]
    moved = {"voltage_v", "ramp_to_v", "frequency", "sweep_to"}
    rest = {key: value for key, value in touch.items() if key not in moved}
    return [pair[::-1] if backwards else pair for pair in values], rest


def turns(condition):
    """Return whether a condition can have repeats in the opposite order."""
    there = [ends(touch) for touch in condition["touches"]]
    back = [ends(touch, backwards=True) for touch in condition["touches"][::-1]]
    return condition["question"] != "places" and condition["expected"] != "same" and there != back


def catches(order, beams, session, slot):
    """Return the condition of each catch trial, by the number of trials before it."""
    wanted, apart = design.get("catch_trials", 0), design.get("catch_apart", 1)
    allowed = [place for place, number in enumerate(order, 1) if len(beams[number]) == 1]
    follow = [sum(other < place + apart for other in allowed) for place in allowed]
    ways = [[1] + [0] * wanted for _ in range(len(allowed) + 1)]
    for i in reversed(range(len(allowed))):
        for left in range(1, wanted + 1):
            ways[i][left] = ways[i + 1][left] + ways[follow[i]][left - 1]
    bits, at, places = stream("catch", session, slot), 0, []
    for left in range(wanted, 0, -1):
        while below(ways[at][left], bits) >= ways[follow[at]][left - 1]:
            at += 1
        places.append(allowed[at])
        at = follow[at]
    found = {}
    for place in places:
        same = [number for number in range(n) if beams[number] == beams[order[place - 1]]]
        found[place] = same[below(len(same), bits)]
    return found


def due(session, slot):
    """Yield kind, condition, level and direction of each trial, as the digest decides them."""
    beams = [{touch.get("beam", own) for touch in each["touches"]} for each in conditions]
    names = [each["name"] for each in conditions]
    levels = [each.get("levels", [1]) for each in conditions]
    pool = [number for number in range(n) if beams[number] == {own}] or list(range(n))
    bits, practice = stream("practice", session, slot), []
    while len(practice) < design.get("practice_trials", 0):
        practice += shuffled(pool, bits)
    for number in practice[: design.get("practice_trials", 0)]:
        yield ["practice", names[number], levels[number][-1], False]
    steps, opposite = [], []
    for number, condition in enumerate(conditions):
        every = islice(cycle(levels[number]), repeats)
        steps.append(shuffled(every, stream("levels", session, slot, number)))
        some = design.get("opposite_repeats", 0) if turns(condition) else 0
        turned = [True] * some + [False] * (repeats - some)
        opposite.append(shuffled(turned, stream("opposite", session, slot, number)))
    order = ordered(session, slot)
    still = catches(order, beams, session, slot)
    for place, number in enumerate(order, 1):
        yield ["trial", names[number], steps[number].pop(), opposite[number].pop()]
        if place in still:
            yield ["catch", names[still[place]], 0, False]


rows = sqlite3.connect(f"file:{folder / 'study.db'}?mode=ro", uri=True).execute(
    "SELECT session, payload FROM event WHERE tag = 'session-opened' AND payload IS NOT NULL"
)
for chain, payload in rows.fetchall():
    opened = json.loads(payload)
    if opened.get("registration") == digest and opened["slot"] is not None and opened["sequence"]:
        seed = int(digest, 16)
        if "group" in opened:  # each group has streams of its own
            seed = int(sha256(f"{seed}/group/{opened['group']}".encode()).hexdigest(), 16)
        had = [
            [trial["kind"], trial["condition"], trial["level"], trial["opposite"]]
            for trial in opened["trials"]
            if trial["kind"] in ("practice", "trial", "catch")
        ]
        same = list(due(opened["session"], opened["slot"])) == had
        print("ok  " if same else "FAIL", chain)
