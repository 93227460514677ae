"""Checks a U3M file against the schema beside this script, and a USDA file's curves against their
counts: check_formats.py NAME.u3m FIBRES.usda. Prints what it found as JSON; mistakes end it."""

import json
import pathlib
import re
import struct
import sys

import jsonschema


def images_in(value):
    """Every image that a part of a U3M file names."""
    if isinstance(value, dict):
        if "path" in value:
            yield value
        for part in value.values():
            yield from images_in(part)


def png_about(path):
    """Size in pixels, bits, and pixels per metre, as the file's own chunks have them."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n", path
    width, height, bits, kind = struct.unpack(">IIBB", data[16:26])
    at = data.index(b"pHYs") + 4
    return width, height, bits, kind, struct.unpack(">IIB", data[at:at + 9])


def check_u3m(path):
    schema = json.loads(pathlib.Path(__file__).with_name("u3m_1_1.schema.json").read_text())
    u3m = json.loads(path.read_text())
    jsonschema.Draft7Validator.check_schema(schema)
    jsonschema.validate(u3m, schema, format_checker=jsonschema.FormatChecker())
    # What no schema says: files are there, and their sizes agree.
    names = set()
    for image in images_in(u3m["material"]):
        width, height, bits, kind, (per_metre_x, _, unit) = png_about(path.parent / image["path"])
        assert unit == 1 and bits in (8, 16) and kind in (2, 6), image
        assert abs(width / image["dpi"]["x"] * 25.4 / image["width"] - 1) < 1e-4, image
        assert abs(height / image["dpi"]["y"] * 25.4 / image["height"] - 1) < 1e-4, image
        assert abs(per_metre_x * image["width"] / 1000 / width - 1) < 1e-3, image
        names.add(image["path"])
    parts = u3m["material"]["physics"]["composition"]["parts"]
    assert abs(sum(part["ratio"] for part in parts) - 1) < 1e-9
    for broken in ({"schema": "1.0"}, {"material": None}, {"other": 1}):
        if not list(jsonschema.Draft7Validator(schema).iter_errors({**u3m, **broken})):
            raise AssertionError(f"the schema takes {broken}")
    return {"images": sorted(names), "physics": u3m["material"]["physics"]}


def check_usda(path):
    """A reading of the part of USDA that such files use, by the grammar's own words."""
    text = path.read_text()
    assert text.startswith("#usda 1.0\n")
    assert text.count("{") == text.count("}") and text.count("[") == text.count("]")
    curves, points = 0, 0
    for prim in re.split(r"def BasisCurves ", text)[1:]:
        assert re.match(r'"[A-Za-z_][A-Za-z0-9_]*"', prim)
        listed = dict(re.findall(r"(\w+(?::\w+)?) = \[(.*?)\]", prim, re.S))
        counts = [int(x) for x in listed["curveVertexCounts"].split(",")]
        assert len(listed["widths"].split(",")) == len(counts)
        places = re.findall(r"\(([^)]*)\)", listed["points"])
        assert len(places) == sum(counts)
        low, high = [[float(x) for x in end.split(",")]
                     for end in re.findall(r"\(([^)]*)\)", listed["extent"])]
        for place in places:
            xyz = [float(x) for x in place.split(",")]
            assert len(xyz) == 3 and all(l <= x <= h for l, x, h in zip(low, xyz, high)), place
        curves, points = curves + len(counts), points + len(places)
    return {"curves": curves, "points": points}


print(json.dumps({"u3m": check_u3m(pathlib.Path(sys.argv[1])),
                  "usda": check_usda(pathlib.Path(sys.argv[2]))}))
