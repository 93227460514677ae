#!/usr/bin/python3
"""Lets a square of cloth fall over a ball and writes it as OBJ meshes with texture coordinates.

Usage: drape.py OUTPUT.obj             the cloth at rest
       drape.py --frames N NAME_%04d.obj   N meshes of its fall, the last one at rest

A grid of points is moved by gravity and pulled back to the lengths of its edges and diagonals
(position based dynamics, Mueller et al. 2007), in fixed steps: the same numbers every time.
Lengths are millimetres.
"""

import argparse

import numpy as np

SIDE = 36            # squares along a side
SIZE_MM = 30.0
BALL_MM = 6.5        # radius; its centre is the origin
FLOOR_MM = -8.5
GAP_MM = 0.35        # that the middle of the cloth keeps from ball and floor
STEPS = 240
SWEEPS = 14
GRAVITY_MM = 0.030   # per step and step
DAMPING = 0.97


def pairs_of(n):
    """Index pairs with their rest lengths: edges, diagonals, and every second point for bending."""
    index = np.arange((n + 1) * (n + 1)).reshape(n + 1, n + 1)
    cell = SIZE_MM / n
    groups = []
    for dx, dy, stiffness in ((1, 0, 1.0), (0, 1, 1.0), (1, 1, 0.5), (1, -1, 0.5), (2, 0, 0.12),
                              (0, 2, 0.12)):
        # Two colours a direction, so that no point is twice in one group.
        for parity in range(2 * max(dx, abs(dy))):
            rows, columns = np.mgrid[0:n + 1, 0:n + 1]
            along = columns if dx else rows
            use = (rows + dy >= 0) & (rows + dy <= n) & (columns + dx <= n)
            use &= along % (2 * max(dx, abs(dy))) == parity
            a = index[rows[use], columns[use]]
            b = index[rows[use] + dy, columns[use] + dx]
            groups.append((a, b, cell * np.hypot(dx, dy), stiffness))
    return groups


def keep_outside(points, before):
    """Pushes points out of the ball and the floor; what touches sticks in part."""
    distance = np.linalg.norm(points, axis=1)
    inside = distance < BALL_MM + GAP_MM
    points[inside] *= ((BALL_MM + GAP_MM) / distance[inside])[:, None]
    below = points[:, 2] < FLOOR_MM + GAP_MM
    points[below, 2] = FLOOR_MM + GAP_MM
    for touching in (inside, below):
        points[touching] += 0.6 * (before[touching] - points[touching]) * (
            1 if touching is inside else np.array([1, 1, 0]))


def fall():
    """Yields the points after every step."""
    n = SIDE
    y, x = np.mgrid[0:n + 1, 0:n + 1] / n - 0.5
    turn = np.radians(12)  # aslant to the axes, so that nothing is symmetric by chance
    points = np.stack([SIZE_MM * (x * np.cos(turn) - y * np.sin(turn)) + 0.4,
                       SIZE_MM * (x * np.sin(turn) + y * np.cos(turn)) - 0.3,
                       BALL_MM + GAP_MM + 0.05 + 0.02 * np.sin(9 * x + 4 * y)],
                      axis=-1).reshape(-1, 3)
    groups = pairs_of(n)
    speed = np.zeros_like(points)
    for _ in range(STEPS):
        before = points.copy()
        speed[:, 2] -= GRAVITY_MM
        points = points + speed
        for _ in range(SWEEPS):
            for a, b, rest, stiffness in groups:
                way = points[b] - points[a]
                length = np.linalg.norm(way, axis=1)
                pull = 0.5 * stiffness * (1 - rest / np.maximum(length, 1e-9))
                points[a] += pull[:, None] * way
                points[b] -= pull[:, None] * way
        keep_outside(points, before)
        speed = DAMPING * (points - before)
        yield points


def write_obj(path, points):
    n = SIDE
    lines = [f"# A square of {SIZE_MM:g} mm over a ball of {BALL_MM:g} mm, made by drape.py."]
    lines += ["v %.4f %.4f %.4f" % tuple(p) for p in points]
    lines += ["vt %.5f %.5f" % (x / n, y / n) for y in range(n + 1) for x in range(n + 1)]
    for y in range(n):
        for x in range(n):
            corners = [y * (n + 1) + x + 1, y * (n + 1) + x + 2, (y + 1) * (n + 1) + x + 2,
                       (y + 1) * (n + 1) + x + 1]
            lines.append("f " + " ".join(f"{c}/{c}" for c in corners))
    with open(path, "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output")
    parser.add_argument("--frames", type=int, default=0)
    arguments = parser.parse_args()
    wanted = {STEPS - 1: 0}
    if arguments.frames > 0:
        wanted = {round((i + 1) * STEPS / arguments.frames) - 1: i for i in range(arguments.frames)}
    for step, points in enumerate(fall()):
        if step in wanted:
            frame = wanted[step]
            write_obj(arguments.output % frame if arguments.frames else arguments.output, points)


main()
