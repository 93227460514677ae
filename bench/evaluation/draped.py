"""Cloth in folds: whole pictures against path tracing, and the time path tracing needs to be as
good."""

from evaluation import scenes
from evaluation.renderer import ROOT, say

LIGHTS = [None, 10, 50, 150, 400]
METHODS = ["precomputed", "device", "dual"]
# The paper's figure 16, as far as there are databases of them.
PREFERRED = ["fleece", "silk_plain", "satin_2_3"]


def chosen(fabrics):
    """At most three fabrics, the preferred ones first."""
    def rank(fabric):
        return next((i for i, name in enumerate(PREFERRED) if fabric.name.startswith(name)),
                    len(PREFERRED))
    return sorted(fabrics, key=rank)[:3]


def name_of(sharpness):
    return "directional" if sharpness is None else f"sg{sharpness}"


def draw(bench, out, fabric, sharpness, deadline, methods):
    """One light: the two references, every method against both, then the crop that is timed."""
    settings = bench.settings
    folder = {"folder": str(ROOT / "examples" / "scenes")}
    for crop, size, samples in [(1.0, settings["draped_size"], settings["draped_reference"]),
                                (0.25, settings["draped_size"] // 4, settings["crop_reference"])]:
        stem = f"{fabric.name}-{name_of(sharpness)}-{size}" + ("" if crop == 1 else "-crop")
        common = {"part": "draped", "sharpness": sharpness, "crop": crop, "size": size}
        references = ["path", "truth"] if crop == 1 and settings["draped_truth"] else ["path"]
        for reference in references:
            if deadline.over():
                return False
            kept = out / f"{stem}-{reference}"
            made = bench.draw(dict(common, method=reference), fabric,
                              scenes.draped_scene(sharpness, size, samples, crop), 1,
                              dict(folder, picture=f"{kept}.exr", error_picture=f"{kept}-error.exr",
                                   preview=f"{kept}.png"))
            if made is None:
                continue
            for method in methods:
                inputs = dict(common, method=method, reference=reference,
                              reference_samples=samples)
                bench.draw(inputs, fabric,
                           scenes.draped_scene(sharpness, size, settings["draped_samples"], crop),
                           2, dict(folder, picture=f"{out / stem}-{method}.exr",
                                   preview=f"{out / stem}-{method}.png", against=f"{kept}.exr",
                                   against_error=f"{kept}-error.exr"))
    return True


def run(bench, fabrics, deadline, out, methods=None):
    out.mkdir(parents=True, exist_ok=True)
    for sharpness in LIGHTS:
        for fabric in chosen(fabrics):
            if not draw(bench, out, fabric, sharpness, deadline, methods or METHODS):
                say("draped: time is up")
                return
            say(f"draped: {fabric.name}, {name_of(sharpness)}; "
                f"{deadline.minutes_left():.0f} minutes left")


def own_rmse(answer):
    """The RMSE of a picture against the converged reference: the reference's noise is taken off."""
    square = answer["rmse"] ** 2 - answer["reference_noise"] ** 2
    return max(0.0, square) ** 0.5


def equal_quality(answer, reference):
    """How many times as long as a method's picture path tracing takes to reach its RMSE.

    Path tracing has no error but noise: its RMSE is b / sqrt(n) after n samples, where b is measured
    by the reference picture's own standard error. Both times are of the same crop in one run.
    """
    rmse = own_rmse(answer)
    if rmse <= 0:
        return None
    samples = reference["noise"] ** 2 * reference["samples"] / rmse ** 2
    return samples * reference["seconds"] / reference["samples"] / answer["seconds"]
