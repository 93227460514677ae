"""The scenes of the evaluation, as protobuf text."""

import math

SHARPNESS = [10, 50, 150, 400, 1000]  # of the paper's lights, and one sharper


def direction(polar_deg, azimuth_deg):
    polar, azimuth = math.radians(polar_deg), math.radians(azimuth_deg)
    return (math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth),
            math.cos(polar))


def vector(values):
    return "{ x: %.9g y: %.9g z: %.9g }" % tuple(values)


def light_text(towards, sharpness):
    """A directional light for sharpness None, else a spherical Gaussian."""
    if sharpness is None:
        return f"lights {{ directional {{ towards {vector(towards)} }} }}\n"
    return f"lights {{ sg {{ towards {vector(towards)} sharpness: {sharpness} }} }}\n"


def picture_text(width, height, samples):
    return f"picture {{ width: {width} height: {height} samples_per_pixel: {samples} }}\n"


def flat_scene(tile_mm, light, view, sharpness, size, samples=16):
    """An endless flat swatch over a black sheet, two tiles high; light and view as (polar, azimuth)
    in degrees. Lights are cut at the horizon."""
    eye = direction(*view)
    height = 2 * tile_mm[1]
    width = max(8, round(size * tile_mm[0] / tile_mm[1]))
    up = "{ y: 1 }" if eye[2] > 0.999 else "{ z: 1 }"
    return (f"camera {{ position {vector([100 * c for c in eye])} look_at {{ }} up {up} "
            f"orthographic {{ height_mm: {height * max(0.2, eye[2]):.9g} }} }}\n"
            + light_text(direction(*light), sharpness)
            + "cloths { flat { endless: true } black_underlay: true }\n"
            + picture_text(width, size, samples) + "cut_lights_at_horizon: true\n")


DRAPED_ANGLE_DEG = 34.0
DRAPED_LIGHT = (-0.6, -0.35, 0.7)


def draped_scene(sharpness, size, samples, crop=1.0):
    """A small cloth in folds over a black sheet of its shape; `crop` is the share of the picture's
    height about its middle that is drawn."""
    angle = math.degrees(2 * math.atan(crop * math.tan(math.radians(DRAPED_ANGLE_DEG / 2))))
    return (f"camera {{ position {{ x: 8 y: -34 z: 26 }} look_at {{ z: -3 }} "
            f"perspective {{ vertical_angle_deg: {angle:.9g} }} }}\n"
            + light_text(DRAPED_LIGHT, sharpness)
            + "cloths { shell { obj_file: \"handkerchief.obj\" texture_width_mm: 26 "
              "texture_height_mm: 26 } black_underlay: true }\n"
            + picture_text(size, size, samples) + "cut_lights_at_horizon: true\n")
