#!/usr/bin/python3
"""Draws what a fabric database holds, as plots: what pieces of fibre see of the sky, how the light of
one cell is transferred, and the grid of cells over the tile.

    examples/look_into_a_fabric.py tiny.h5 -o plots

Needs numpy, h5py, matplotlib, grpcio and protobuf (Debian: python3-h5py python3-matplotlib
python3-grpcio python3-protobuf). Read from top to bottom like a notebook: each part stands alone.
"""

import argparse
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")  # pictures in files; no window
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
import weft  # noqa: E402

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("database", help="a fabric database (.h5)")
options.add_argument("-o", "--output", default="plots", help="folder for the plots")
options = options.parse_args()
folder = pathlib.Path(options.output)
folder.mkdir(parents=True, exist_ok=True)
try:
    fabric = weft.Database(options.database)
except OSError as error:
    sys.exit(f"{options.database} cannot be opened: {error}")
name = fabric.description["name"]


def save(figure, file, what):
    figure.savefig(folder / file, dpi=110)
    plt.close(figure)
    print(f"{folder / file}: {what}")


# ---------------------------------------------------------------- what pieces of fibre see of the sky
# The upper half of the sphere of directions, straight up in the middle, the horizon at the rim. Of 300
# segments spread over the tile, four from almost hidden to almost open.

theta, phi = fabric["visibility/theta"], fabric["visibility/phi"]
upper = theta < np.pi / 2
solid_angle = np.sin(theta[upper]) / np.sin(theta[upper]).sum()
segments = np.unique(np.linspace(0, len(fabric["visibility/open_share"]) - 1, 300).astype(int))
share = np.array([solid_angle @ fabric.visibility(k)[upper].mean(axis=1) for k in segments])
order = np.argsort(share)[np.sort(share) > 0.01]
chosen = order[(np.array([0.2, 0.5, 0.8, 1]) * (len(order) - 1)).astype(int)]

figure, axes = plt.subplots(1, 4, figsize=(14, 4), subplot_kw={"projection": "polar"},
                            layout="constrained")
for axis, segment, seen in zip(axes, segments[chosen], share[chosen]):
    distance = fabric.signed_distance(segment)[upper]
    step = phi[1] - phi[0]
    edges = np.append(phi, phi[-1] + step) - step / 2
    rings = np.degrees(np.linspace(0, np.pi / 2, distance.shape[0] + 1))
    axis.grid(False)
    mesh = axis.pcolormesh(edges, rings, np.clip(distance, -0.4, 0.4), cmap="RdBu", vmin=-0.4,
                           vmax=0.4, shading="flat")
    closed = np.column_stack([distance, distance[:, 0]])
    if distance.min() < 0 < distance.max():
        axis.contour(np.append(phi, phi[0] + 2 * np.pi), np.degrees(theta[upper]), closed,
                     levels=[0], colors="black", linewidths=1)
    axis.set_title(f"segment {segment}\nsees {100 * seen:.1f} % of the sky", fontsize=10)
    axis.set_yticks([30, 60, 90], ["30°", "60°", ""], fontsize=7)
    axis.set_xticks(np.radians([0, 90, 180, 270]), ["across", "along", "", ""], fontsize=8)
    axis.grid(alpha=0.4)
figure.colorbar(mesh, ax=axes, shrink=0.8,
                label="distance to the edge (radians)")
figure.suptitle(f"{name}: visibility of the sky (blue: seen)")
save(figure, "visibility.png", "what four segments see of the sky")

# ----------------------------------------------------------------- how a cell's light is transferred
# Rows: harmonics of the radiance that arrives in the cell; columns: harmonics of the light. Lines
# divide the orders. The cell passes on more light than nine in ten do.

transfer = fabric["iirtf/transfer"].astype(float)
uniform = transfer[:, :, 0, 0].mean(axis=1)
cell = int(np.argsort(uniform)[int(0.9 * (len(uniform) - 1))])
matrices = fabric.transfer(cell)
limit = np.quantile(np.abs(matrices), 0.995)
figure, axes = plt.subplots(1, 3, figsize=(14, 4.8), layout="constrained")
for axis, matrix, channel in zip(axes, matrices, ("red", "green", "blue")):
    image = axis.imshow(matrix, cmap="RdBu", vmin=-limit, vmax=limit)
    orders = int(np.sqrt(len(matrix)))
    for bound in np.arange(1, orders) ** 2 - 0.5:
        axis.axhline(bound, color="grey", linewidth=0.4)
        axis.axvline(bound, color="grey", linewidth=0.4)
    ticks = np.arange(orders) ** 2 + np.arange(orders)
    axis.set_xticks(ticks, range(orders))
    axis.set_yticks(ticks, range(orders))
    axis.set_xlabel("order of the light")
    axis.set_title(channel)
axes[0].set_ylabel("order of the radiance round the fibre")
figure.colorbar(image, ax=axes, shrink=0.85)
figure.suptitle(f"{name}: transfer matrices of cell {cell}")
save(figure, "transfer.png", f"the transfer matrices of cell {cell}")

# ----------------------------------------------------------------------------- the grid of cells
# The tile from above with its fibres' axes, and the cells' boxes; and how bright each cell passes
# light on: the mean of the first coefficient, which takes uniform light to uniform radiance.

grid = fabric.cell_grid()
width, height = fabric.size_mm
low, high = fabric["exemplar/z_bounds_mm"]
brightness = transfer[:, :, 0, 0].mean(axis=1)
figure, (from_above, section) = plt.subplots(1, 2, figsize=(14, 5.5), layout="constrained")
top = np.full(grid.shape[:2], np.nan)
for layer in range(grid.shape[2]):  # the highest cell of each column is the one on top
    here = grid[:, :, layer]
    top[here >= 0] = brightness[here[here >= 0]]
image = from_above.imshow(top.T, origin="lower", extent=(0, width, 0, height), cmap="viridis",
                          vmin=0, vmax=brightness.max())
starts, ends = fabric.segment_ends()
middle = (starts + ends) / 2
shift = np.floor(middle[:, :2] / (width, height)) * (width, height)
lines = np.stack([starts[:, :2] - shift, ends[:, :2] - shift], axis=1)
from_above.add_collection(
    matplotlib.collections.LineCollection(lines, colors="white", linewidths=0.4, alpha=0.6))
from_above.set(xlim=(0, width), ylim=(0, height), xlabel="across (mm)", ylabel="along (mm)",
               title="the highest cells, and the fibres' axes")
for count, size, line in ((grid.shape[0], width, from_above.axvline),
                          (grid.shape[1], height, from_above.axhline)):
    for bound in np.linspace(0, size, count + 1):
        line(bound, color="black", linewidth=0.8)
values = np.where(grid >= 0, brightness[grid], np.nan)
with np.errstate(invalid="ignore"):
    count = np.sum(~np.isnan(values), axis=1)
    mean = np.nansum(values, axis=1) / np.where(count > 0, count, np.nan)
section.imshow(mean.T, origin="lower", extent=(0, width, low, high), aspect="auto", cmap="viridis",
               vmin=0, vmax=brightness.max())
section.set(xlabel="across (mm)", ylabel="height (mm)", title="mean over the rows along the cloth")
figure.colorbar(image, ax=[from_above, section], shrink=0.85,
                label="transfer of uniform light, mean of three colours")
figure.suptitle(f"{name}: {len(brightness)} cells, {grid.shape[0]} x {grid.shape[1]} x {grid.shape[2]}")
save(figure, "cells.png", "the grid of cells")
