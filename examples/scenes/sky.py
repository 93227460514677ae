#!/usr/bin/python3
"""Writes a picture of a sky in latitude and longitude as OpenEXR: a gradient, a sun with its glow, a
dim ground.

Usage: sky.py OUTPUT.exr
"""

import struct
import sys

import numpy as np

WIDTH, HEIGHT = 256, 128
SUN = np.array([-0.55, -0.45, 0.7])  # towards it; z is up
SUN /= np.linalg.norm(SUN)


def sky():
    """Radiance, [height, width, 3]; the top row is straight up, the middle column +y."""
    theta = np.pi * (np.arange(HEIGHT) + 0.5) / HEIGHT
    phi = 2 * np.pi * ((np.arange(WIDTH) + 0.5) / WIDTH - 0.5)
    sine = np.sin(theta)[:, None]
    direction = np.stack([sine * np.sin(phi), sine * np.cos(phi),
                          np.cos(theta)[:, None] * np.ones(WIDTH)], axis=-1)
    up = direction[..., 2:3]
    zenith, horizon, ground = (np.array(c) for c in ([0.10, 0.18, 0.42], [0.55, 0.60, 0.65],
                                                     [0.06, 0.05, 0.04]))
    share = np.clip(up, 0, 1) ** 0.6
    radiance = np.where(up > 0, horizon + share * (zenith - horizon), ground)
    near = direction @ SUN
    glow = 1.5 * np.exp(40 * (near - 1)) + 60 * np.exp(900 * (near - 1))
    return radiance + glow[..., None] * np.array([1.0, 0.9, 0.75])


def attribute(name, kind, data):
    return name + b"\0" + kind + b"\0" + struct.pack("<i", len(data)) + data


def exr_of(pixels):
    """An uncompressed OpenEXR file of 32-bit floats, line by line."""
    height, width, _ = pixels.shape
    channels = b"".join(c + b"\0" + struct.pack("<iB3xii", 2, 0, 1, 1)
                        for c in (b"B", b"G", b"R")) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = struct.pack("<ii", 20000630, 2)
    header += attribute(b"channels", b"chlist", channels)
    header += attribute(b"compression", b"compression", b"\0")
    header += attribute(b"dataWindow", b"box2i", window)
    header += attribute(b"displayWindow", b"box2i", window)
    header += attribute(b"lineOrder", b"lineOrder", b"\0")
    header += attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1))
    header += attribute(b"screenWindowCenter", b"v2f", struct.pack("<2f", 0, 0))
    header += attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1)) + b"\0"
    lines = [np.ascontiguousarray(pixels[y, :, ::-1].T, dtype="<f4").tobytes()
             for y in range(height)]
    first = len(header) + 8 * height
    step = 8 + len(lines[0])
    offsets = struct.pack(f"<{height}Q", *(first + step * y for y in range(height)))
    return header + offsets + b"".join(struct.pack("<ii", y, len(line)) + line
                                       for y, line in enumerate(lines))


with open(sys.argv[1], "wb") as file:
    file.write(exr_of(sky()))
