"""Flat swatches: 492 combinations of light and view per fabric, and a few under every light."""

import math

from evaluation import scenes
from evaluation.renderer import say

# Khungurn et al. 2015 validated their materials under 492 combinations that no text lists. Ours: a
# directional light from 12 directions (polar angle 15, 35, 55, 75 degrees; azimuth 0, 45, 90: along
# the weft, aslant, along the warp) seen from 41 (from above, and polar angle 15, 30, 45, 60, 75 at
# eight azimuths).
LIGHTS = [(polar, azimuth) for polar in (15, 35, 55, 75) for azimuth in (0, 45, 90)]
VIEWS = [(0, 0)] + [(polar, azimuth) for polar in (15, 30, 45, 60, 75)
                    for azimuth in range(0, 360, 45)]
CONFIGURATIONS = [(light, view) for light in LIGHTS for view in VIEWS]
assert len(CONFIGURATIONS) == 492
# Any number of them from the start is spread over all: 305, about 492 over the golden ratio, has no
# factor in common with 492.
ORDER = [(305 * k) % 492 for k in range(492)]
assert len(set(ORDER)) == 492

METHODS = ["path", "precomputed", "device", "device-32", "device-64", "device-128", "dual"]
LIGHTS_METHODS = ["path", "precomputed", "device", "dual"]
SEEDS = {"path": 1}  # every other method draws other samples: errors are independent


def run(bench, fabrics, deadline, methods=None):
    settings = bench.settings
    for count, index in enumerate(ORDER[:settings["configurations"]]):
        light, view = CONFIGURATIONS[index]
        for fabric in fabrics:
            for method in methods or METHODS:
                if deadline.over():
                    say(f"flat: time is up after {count} configurations")
                    return
                inputs = {"part": "flat", "method": method, "light": light, "view": view}
                bench.draw(inputs, fabric,
                           scenes.flat_scene(fabric.tile_mm, light, view, None, settings["size"]),
                           SEEDS.get(method, 2),
                           {"target_error": settings["target_error"],
                            "most_samples": settings["most_samples"]})
        if (count + 1) % 4 == 0:
            say(f"flat: {count + 1} of {settings['configurations']} configurations, "
                f"{deadline.minutes_left():.0f} minutes left")


# One light from 40 degrees, from two sides, as sharp as the paper's lights and sharper.
LIGHT = (40, 60)
SIDES = {"normal": (0, 0), "oblique": (45, 200)}
TERMS = {"all": None, "single": "SCATTERING_SINGLE_ONLY", "multiple": "SCATTERING_MULTIPLE_ONLY"}


def run_lights(bench, fabrics, deadline, methods=None):
    """Mean colour under every kind of light, all terms and single and multiple scattering apart."""
    settings = bench.settings
    for term in settings["terms"]:
        for sharpness in [None] + scenes.SHARPNESS:
            for fabric in fabrics:
                for side, view in SIDES.items():
                    for method in methods or LIGHTS_METHODS:
                        if deadline.over():
                            say("lights: time is up")
                            return
                        inputs = {"part": "lights", "method": method, "sharpness": sharpness,
                                  "side": side, "term": term}
                        if TERMS[term]:
                            inputs["scattering"] = TERMS[term]
                        bench.draw(inputs, fabric,
                                   scenes.flat_scene(fabric.tile_mm, LIGHT, view, sharpness,
                                                     settings["size"]),
                                   SEEDS.get(method, 2),
                                   {"target_error": settings["target_error"],
                                    "most_samples": 2 * settings["most_samples"]})
            say(f"lights: {term}, {'directional' if sharpness is None else f'SG {sharpness}'}")


def brightness(colour):
    return sum(colour) / 3


def errors(answer, reference):
    """Of one picture's mean colour: differences per channel and their variance by noise."""
    differences = [a - b for a, b in zip(answer["cloth_mean"], reference["cloth_mean"])]
    variances = [a * a + b * b for a, b in zip(answer["cloth_standard_error"],
                                               reference["cloth_standard_error"])]
    return differences, variances


def root_mean_square(pairs):
    """RMS error of mean colour over pairs (answer, reference), noise taken off, with its standard
    error by noise; both relative to the references' mean."""
    squares, variances, slope = 0.0, 0.0, 0.0
    count = 0
    for answer, reference in pairs:
        for difference, variance in zip(*errors(answer, reference)):
            squares += difference * difference
            variances += variance
            slope += 2 * variance * variance + 4 * variance * max(0.0, difference ** 2 - variance)
            count += 1
    scale = sum(brightness(reference["cloth_mean"]) for _, reference in pairs) / len(pairs)
    mean_square = max(0.0, (squares - variances) / count)
    error = math.sqrt(slope) / count  # of the mean square
    root = math.sqrt(mean_square)
    return root / scale, (error / (2 * root) if root > math.sqrt(error) else math.sqrt(error)) / scale


def signed(pairs):
    """Mean relative error of brightness over pairs, with its standard error by noise."""
    total, variance = 0.0, 0.0
    for answer, reference in pairs:
        light = brightness(reference["cloth_mean"])
        differences, variances = errors(answer, reference)
        total += sum(differences) / 3 / light
        # The channels share their paths: their errors add.
        variance += (sum(math.sqrt(v) for v in variances) / 3 / light) ** 2
    return total / len(pairs), math.sqrt(variance) / len(pairs)
