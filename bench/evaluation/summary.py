"""The tables of docs/accuracy.md, from what has been recorded."""

import pathlib
import re

from evaluation import draped, flat, scenes


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def percent(value, error=None):
    return f"{100 * value:.1f}" + (f" ± {100 * error:.1f}" if error is not None else "")


def grouped(record, part, by):
    """{fabric: {by(inputs): {method: answer}}} of one part; the latest database of a name counts."""
    groups = {}
    for case in record.of_part(part):
        inputs = case["inputs"]
        fabric = groups.setdefault(inputs["fabric"], {})
        fabric.setdefault(by(inputs), {})[inputs["method"]] = case["answer"]
    return groups


def methods_in(groups):
    found = []
    for fabric in groups.values():
        for answers in fabric.values():
            found += [m for m in answers if m not in found and m not in ("path", "truth")]
    return found


def pairs_of(cases, method, reference="path"):
    return [(answers[method], answers[reference]) for answers in cases
            if method in answers and reference in answers]


def flat_tables(record):
    groups = grouped(record, "flat", lambda i: (tuple(i["light"]), tuple(i["view"])))
    if not groups:
        return None
    methods = methods_in(groups)
    rows, near_rows = [], []
    for fabric, cases in sorted(groups.items()):
        row = [fabric, str(sum("path" in answers for answers in cases.values()))]
        near = [answers for (light, view), answers in cases.items()
                if light[0] <= 60 and view[0] <= 60]
        for method in methods:
            pairs = pairs_of(cases.values(), method)
            row.append(percent(*flat.root_mean_square(pairs)) if pairs else "–")
            pairs = pairs_of(near, method)
            if pairs:
                beyond = sum(is_beyond(pair, 0.05) for pair in pairs)
                near_rows.append([fabric, method, str(len(pairs)),
                                  percent(*flat.signed(pairs)),
                                  percent(*flat.root_mean_square(pairs)), str(beyond)])
        rows.append(row)
    text = ("Root mean square error of the mean colour, in per cent of its mean over all "
            "configurations, noise taken off, ± its standard error by noise:\n\n"
            + table(["fabric", "configurations"] + methods, rows)
            + "\n\nLight and view within 60 degrees of the normal: mean error of the brightness with "
            "its sign, root mean square error of the mean colour, and in how many configurations the "
            "brightness is off by more than 5 % (by two standard errors more):\n\n"
            + table(["fabric", "method", "configurations", "mean error, %", "RMSE, %",
                     "beyond 5 %"], near_rows))
    apart = [abs(flat.signed([pair])[0]) for cases in groups.values()
             for pair in pairs_of(cases.values(), "device", "precomputed")]
    if apart:
        text += (f"\n\nBrightness by the device and by the CPU: {100 * sum(apart) / len(apart):.2f} % "
                 f"apart in the mean over {len(apart):,} configurations, {100 * max(apart):.1f} % at "
                 "most.")
    wrong = [(f, m) for f, cases in groups.items() for answers in cases.values()
             for m, answer in answers.items() if answer["wrong_pixels"]]
    text += (f"\n\nPictures with a pixel that is negative or no number: {len(wrong)} of "
             f"{sum(len(a) for c in groups.values() for a in c.values())}.")
    return text


def is_beyond(pair, limit):
    error, noise = flat.signed([pair])
    return abs(error) - 2 * noise > limit


def lights_table(record):
    groups = grouped(record, "lights", lambda i: (i["side"], i["term"], i["sharpness"]))
    if not groups:
        return None
    lights = [None] + scenes.SHARPNESS
    rows = []
    for fabric, cases in sorted(groups.items()):
        for side in flat.SIDES:
            for term in flat.TERMS:
                for method in methods_in(groups):
                    cells = []
                    for sharpness in lights:
                        pairs = pairs_of([cases.get((side, term, sharpness), {})], method)
                        cells.append(percent(*flat.signed(pairs)) if pairs else "–")
                    if any(cell != "–" for cell in cells):
                        rows.append([fabric, side, term, method] + cells)
    return table(["fabric", "view", "terms", "method", "directional"]
                 + [f"SG {s}" for s in scenes.SHARPNESS], rows)


def draped_table(record):
    cases = record.of_part("draped")
    if not cases:
        return None

    def key(inputs):
        return (inputs["fabric"], str(inputs["sharpness"]), inputs["crop"], inputs["size"])
    references = {key(c["inputs"]) + (c["inputs"]["method"],): c["answer"] for c in cases
                  if "reference" not in c["inputs"]}
    timed = {key(c["inputs"])[:2] + (c["inputs"]["method"],): (c["answer"], key(c["inputs"]))
             for c in cases if "reference" in c["inputs"] and c["inputs"]["crop"] != 1}
    rows = []
    for case in cases:
        inputs, answer = case["inputs"], case["answer"]
        if "reference" not in inputs or inputs["crop"] != 1:
            continue
        reference = references.get(key(inputs) + (inputs["reference"],))
        light = "directional" if inputs["sharpness"] is None else f"SG {inputs['sharpness']}"
        mean = sum(answer["reference_mean"]) / 3
        row = [inputs["fabric"], light, inputs["method"],
               "`path --local`" if inputs["reference"] == "path" else "`path`",
               percent(draped.own_rmse(answer) / mean),
               percent(*flat.signed([(answer, reference)])) if reference else "–",
               f"{answer['ssim']:.3f}", f"{answer['seconds']:.1f}"]
        ratio = "–"
        crop = timed.get(key(inputs)[:2] + (inputs["method"],))
        if crop and inputs["reference"] == "path":
            times = draped.equal_quality(crop[0], references[crop[1] + ("path",)])
            ratio = f"{times:.1f}" if times else "beyond measure"
        rows.append(row + [ratio])
    return table(["fabric", "light", "method", "reference", "RMSE, %", "mean colour, %", "SSIM",
                  "seconds", "path's time to equal RMSE"], sorted(rows))


def studies_tables(record):
    cases = record.of_part("studies")
    references = {}
    settings = {}
    for case in cases:
        inputs = case["inputs"]
        name = re.sub(r"-cells-.*", "", inputs["fabric"])
        where = (str(inputs["sharpness"]), tuple(inputs["view"]), inputs["scattering"])
        if inputs["method"] == "path":
            references[(inputs["fabric"],) + where] = case["answer"]
        else:
            key = (inputs["study"], name, str(inputs["value"]))
            settings.setdefault(key, []).append((inputs["fabric"],) + where + (case["answer"],))
    texts = []
    for study, title in [("cells", "Cell length in mean free paths"),
                         ("order", "Order of the harmonics"), ("blend", "Blend window"),
                         ("components", "Principal components of the distances"),
                         ("precision", "Precision of the tables")]:
        rows = []
        for (which, name, value), drawn in settings.items():
            pairs = [(found[-1], references[found[:-1]]) for found in drawn
                     if found[:-1] in references]
            if which == study and pairs:
                rows.append([name, value, str(len(pairs)), percent(*flat.signed(pairs)),
                             percent(*flat.root_mean_square(pairs))])
        if rows:
            texts.append(f"{title}:\n\n" + table(
                ["fabric", "value", "pictures", "mean error, %", "RMSE of mean colour, %"], rows))
    return "\n\n".join(texts) or None


def responses_table(record):
    rows = [[c["inputs"]["fabric"], c["inputs"]["figure"], scheme["scheme"],
             percent(scheme["relative_rmse"]), percent(scheme["energy"]),
             percent(scheme["lowest"])]
            for c in record.of_part("responses") for scheme in c["answer"]["schemes"]]
    return rows and table(["fabric", "figure", "scheme", "RMSE, % of the largest",
                           "light in all, % of the truth's", "lowest, % of the largest"], rows)


SECTIONS = {"flat": flat_tables, "lights": lights_table, "draped": draped_table,
            "studies": studies_tables, "responses": responses_table}


def write(record, path):
    """Puts the tables between their markers in the document, or on stdout without one."""
    document = pathlib.Path(path).read_text() if path else ""
    for name, make in SECTIONS.items():
        text = make(record)
        if not text:
            continue
        if not path:
            print(f"{text}\n")
            continue
        begin, end = f"<!-- evaluate:{name} -->", f"<!-- /evaluate:{name} -->"
        if begin not in document or end not in document:
            print(f"{path}: no place for {name}; add a line {begin} and a line {end}")
            continue
        before, rest = document.split(begin, 1)
        document = f"{before}{begin}\n\n{text}\n\n{end}{rest.split(end, 1)[1]}"
    if path:
        pathlib.Path(path).write_text(document)
