"""A fabric database as numpy arrays (docs/database_format.md says what each of them is)."""

import functools
import json

import h5py
import numpy


class Database:
    """A fabric database, opened by h5py; `file` is the h5py.File.

    Any dataset comes as an array by its path, `database["iirtf/transfer"]`; the methods put together
    what takes more than one.
    """

    def __init__(self, path):
        self.path = path
        self.file = h5py.File(path, "r")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __getitem__(self, name):
        return self.file[name][...]

    def close(self):
        self.file.close()

    @property
    def description(self):
        """The fabric's description, a dict."""
        return json.loads(self.file["provenance/description"][0])

    @property
    def size_mm(self):
        """Width and height of the tile."""
        return self["exemplar/size_mm"]

    @property
    def strands(self):
        """The fibres of one tile: a list of arrays [points, 3], millimetres."""
        counts = self["exemplar/strands"][:, 0]
        return numpy.split(self["exemplar/points_mm"], numpy.cumsum(counts)[:-1])

    def segment_ends(self):
        """Both ends of every segment: two arrays [segments, 3], millimetres."""
        counts = self["exemplar/strands"][:, 0]
        points = self["exemplar/points_mm"]
        last = numpy.zeros(len(points), dtype=bool)
        last[numpy.cumsum(counts) - 1] = True
        starts = numpy.flatnonzero(~last)
        return points[starts], points[starts + 1]

    def signed_distance(self, segment):
        """Angle to the nearest edge of what a segment sees: [resolution, resolution], radians.

        Rows are the polar angle from straight up, columns the azimuth. Positive: the sky is visible.
        """
        share = float(self.file["visibility/open_share"][segment])
        mean, basis = self._ssdf
        if share in (0.0, 1.0):
            return numpy.full(mean.shape, numpy.pi if share == 1.0 else -numpy.pi)
        weights = self.file["visibility/ssdf/coefficients"][segment].astype(float)
        return mean + numpy.tensordot(weights, basis, 1)

    @functools.cached_property
    def _ssdf(self):
        return self["visibility/ssdf/mean"], self["visibility/ssdf/basis"].astype(float)

    def visibility(self, segment):
        """What a segment sees of the sky: booleans [resolution, resolution], as signed_distance."""
        return self.signed_distance(segment) > 0

    def transfer(self, cell):
        """The transfer matrices of a cell: [3 channels, coefficients out, coefficients in]."""
        return self.file["iirtf/transfer"][cell].astype(float)

    def cell_grid(self):
        """The grid of cells over the tile, [x, y, z]: the number of each cell, -1 where there is none."""
        grid = numpy.full(self["cells/cells_per_axis"], -1, dtype=int)
        places = self["cells/coordinates"]
        grid[tuple(places.T)] = numpy.arange(len(places))
        return grid
