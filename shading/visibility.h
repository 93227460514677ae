// Shared text (C++20 and GLSL): the precomputed visibility of a segment. A visibility map has
// `resolution` rows of the polar angle from +z and as many columns of the azimuth from +x, in the
// frame of the flat fabric; values belong to the pixels' centres.
#ifndef WEFT_SHADING_VISIBILITY_H
#define WEFT_SHADING_VISIBILITY_H

#include "shading/dialect.h"
#include "shading/error_function.h"
#include "shading/fibre_angle.h"

SHARED_BEGIN

// Polar angle and azimuth in pixels: row in [0, resolution], column in [0, resolution).
SHARED vec2 map_coordinates(vec3 w, int resolution) {
  float n = float(resolution);
  float row = angle_of(sqrt(w.x * w.x + w.y * w.y), w.z) * (n / kPi);
  float turn = angle_of(w.y, w.x) * (1.0f / kTwoPi);
  float column = (turn < 0.0f ? turn + 1.0f : turn) * n;
  return vec2(clamp(row, 0.0f, n), column < n ? column : 0.0f);
}

// Index row * resolution + column of the pixel that holds the direction w.
SHARED int map_pixel(vec3 w, int resolution) {
  vec2 p = map_coordinates(w, resolution);
  int row = min(int(p.x), resolution - 1);
  int column = min(int(p.y), resolution - 1);
  return row * resolution + column;
}

// Unit direction of the pixel's centre.
SHARED vec3 map_direction(int row, int column, int resolution) {
  float n = float(resolution);
  float theta = (float(row) + 0.5f) * (kPi / n);
  float phi = (float(column) + 0.5f) * (kTwoPi / n);
  float s = sin(theta);
  return vec3(s * cos(phi), s * sin(phi), cos(theta));
}

// Solid angle of one pixel of `row`; the map's sum is 4 pi.
SHARED float map_solid_angle(int row, int resolution) {
  float n = float(resolution);
  // cos a - cos b = 2 sin((a + b) / 2) sin((b - a) / 2)
  float middle = (float(min(row, resolution - 1 - row)) + 0.5f) * (kPi / n);
  return (kTwoPi / n) * 2.0f * sin(middle) * sin(0.5f * kPi / n);
}

// Four pixels and their weights, which sum to one.
struct MapFootprint {
  int index[4];
  float weight[4];
};

// Beyond a pole the map goes on in the same row half a turn away.
SHARED int map_wrapped_index(int row, int column, int resolution) {
  int r = row;
  int c = column;
  if (r < 0 || r >= resolution) {
    r = r < 0 ? -1 - r : 2 * resolution - 1 - r;
    c += resolution / 2;
  }
  c = c - (c / resolution) * resolution;
  if (c < 0) {
    c += resolution;
  }
  return r * resolution + c;
}

// Bilinear lookup in (theta, phi). REQUIRES: `resolution` is even.
SHARED MapFootprint map_footprint(vec3 w, int resolution) {
  vec2 p = map_coordinates(w, resolution);
  float row = p.x - 0.5f;
  float column = p.y - 0.5f;
  float row_floor = floor(row);
  float column_floor = floor(column);
  float fr = row - row_floor;
  float fc = column - column_floor;
  int r = int(row_floor);
  int c = int(column_floor);
  MapFootprint f;
  f.index[0] = map_wrapped_index(r, c, resolution);
  f.index[1] = map_wrapped_index(r, c + 1, resolution);
  f.index[2] = map_wrapped_index(r + 1, c, resolution);
  f.index[3] = map_wrapped_index(r + 1, c + 1, resolution);
  f.weight[0] = (1.0f - fr) * (1.0f - fc);
  f.weight[1] = (1.0f - fr) * fc;
  f.weight[2] = fr * (1.0f - fc);
  f.weight[3] = fr * fc;
  return f;
}

// Visible share of a spherical Gaussian of sharpness lambda whose axis is `distance` radians inside
// (outside: negative) the visible region, behind a straight edge (Khungurn et al. 2017, section
// 5.2.2; error 0.103 / lambda).
SHARED float ssdf_visibility(float distance, float lambda) {
  return 0.5f * (error_function(sqrt(0.5f * lambda) * distance) + 1.0f);
}

// Share of the signed distance in the blend with the sum of Gaussians: 0 up to `low`, 1 from `high`
// on.
SHARED float ssdf_share(float lambda, float low, float high) {
  return clamp((lambda - low) / max(high - low, 1e-6f), 0.0f, 1.0f);
}

// Axis q = 0 ... count - 1 of the Fibonacci set with half-cell offsets, turned by `rotation` about
// z, on the upper hemisphere: the axes of the visibility Gaussians.
SHARED vec3 fibonacci_axis(int q, int count, float rotation) {
  float z = 1.0f - (float(q) + 0.5f) / float(count);
  float phi = kTwoPi * fract(float(q + 1) * 0.618033989f) + rotation;
  float s = sqrt(max(0.0f, 1.0f - z * z));
  return vec3(s * cos(phi), s * sin(phi), z);
}

// The same over the whole sphere.
SHARED vec3 fibonacci_axis_sphere(int q, int count, float rotation) {
  float z = 1.0f - float(2 * q + 1) / float(count);
  float phi = kTwoPi * fract(float(q + 1) * 0.618033989f) + rotation;
  float s = sqrt(max(0.0f, 1.0f - z * z));
  return vec3(s * cos(phi), s * sin(phi), z);
}

SHARED_END

#endif
