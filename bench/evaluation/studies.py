"""What each choice of the precomputation is worth: one changed at a time, all else as it was."""

import re
import subprocess

from evaluation import scenes
from evaluation.renderer import BIN, ROOT, Fabric, say

# Light and view of the studies: soft and sharp, from above and aslant.
LIGHT = (40, 60)
CASES = [(sharpness, view) for sharpness in (None, 50, 400) for view in ((0, 0), (45, 200))]
BLEND_CASES = [(sharpness, view) for sharpness in (10, 50, 100, 150, 200, 400)
               for view in ((0, 0), (45, 200))]

# Cell length in mean free paths; the last makes one cell of the tile.
CELL_LENGTHS = [0.5, 1, 1.5, 2, 1000]
BLENDS = [(0.5, 1), (10, 20), (20, 80), (50, 100), (100, 200), (200, 400), (1000, 2000)]
COMPONENTS = [4, 8, 16, 24, 32, 48]


def choices(fabric):
    """(study, value, reduction) of everything that needs no other database."""
    order = fabric.about["sh_order"]
    yield from (("order", k, {"sh_order": k} if k < order else {}) for k in range(order + 1))
    most = fabric.about["pca_components"]
    yield from (("components", k, {"components": k} if k < most else {})
                for k in COMPONENTS if k <= most)
    yield "precision", "half", {"half": True}
    yield "precision", "float", {}
    yield from (("blend", f"{low:g} to {high:g}", {"blend": [low, high]}) for low, high in BLENDS)


def draw(bench, fabric, study, value, reduction, deadline):
    settings = bench.settings
    cases = BLEND_CASES if study == "blend" else CASES
    # The Gaussians and the distances show in single scattering alone, the harmonics in the rest.
    term = {"blend": "SCATTERING_SINGLE_ONLY", "components": "SCATTERING_SINGLE_ONLY",
            "order": "SCATTERING_MULTIPLE_ONLY", "cells": "SCATTERING_MULTIPLE_ONLY"}.get(study)
    for sharpness, view in cases:
        for method in ("path", "precomputed"):
            if deadline.over():
                return False
            inputs = {"part": "studies", "method": method, "sharpness": sharpness, "view": view,
                      "scattering": term}
            request = {"target_error": settings["target_error"],
                       "most_samples": 2 * settings["most_samples"]}
            if method == "precomputed":
                inputs.update(study=study, value=value)
                request["reduce"] = reduction
            bench.draw(inputs, fabric,
                       scenes.flat_scene(fabric.tile_mm, LIGHT, view, sharpness, settings["size"]),
                       1 if method == "path" else 2, request)
    return True


def run(bench, fabrics, deadline, out, methods=None):
    del methods  # references and precomputed rendering only
    for fabric in fabrics[:bench.settings["study_fabrics"]]:
        for study, value, reduction in choices(fabric):
            if not draw(bench, fabric, study, value, reduction, deadline):
                say("studies: time is up")
                return
        say(f"studies: {fabric.name}; {deadline.minutes_left():.0f} minutes left")
    run_cells(bench, fabrics, deadline, out)


def variant(description, cell_length_mfp):
    """The description with its own precomputation settings replaced: a tile of two repeats each way
    at order 4 and 4,096 paths a cell, so that cells alone differ."""
    text = re.sub(r"\nprecompute\s*\{[^{}]*\}", "", "\n" + description)
    text = re.sub(r"repeats_([xy]): *[0-9]+", r"repeats_\1: 2", text)
    return (text + f"\nprecompute {{ quality: QUALITY_PAPER cell_length_mfp: {cell_length_mfp} "
            "sh_order: 4 paths_per_cell: 4096 pca_sample_segments: 1024 }\n")


def run_cells(bench, fabrics, deadline, out):
    """Makes the databases of other cell lengths (visibility is made once: it does not know cells)."""
    out.mkdir(parents=True, exist_ok=True)
    for fabric in fabrics[:bench.settings["cell_fabrics"]]:
        description = ROOT / "examples" / f"{fabric.about['name']}.textproto"
        if not description.exists():
            say(f"studies: no description of {fabric.name} in examples/, its cells are left out")
            continue
        for length in reversed(bench.settings["cell_lengths"]):
            name = f"{fabric.about['name']}-cells-{length:g}"
            database = out / f"{name}.h5"
            if not database.exists():
                if deadline.over():
                    say("studies: time is up")
                    return
                say(f"studies: making {database.name}")
                source = out / f"{name}.textproto"
                source.write_text(variant(description.read_text(), length))
                made = subprocess.run([BIN / "weft", "run", source, "-o", database, "--cache",
                                       out / "cache"], stdout=subprocess.DEVNULL,
                                      stderr=subprocess.PIPE, text=True, check=False)
                if made.returncode != 0:
                    say(f"studies: {made.stderr.strip().splitlines()[-1:]}")
                    continue
            if not draw(bench, Fabric(database), "cells",
                        "one" if length >= 1000 else length, {}, deadline):
                say("studies: time is up")
                return
