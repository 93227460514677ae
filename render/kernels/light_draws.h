// Shared text (C++20 and GLSL): directions drawn towards lights, as render/light.cpp draws them.
#ifndef WEFT_RENDER_KERNELS_LIGHT_DRAWS_H
#define WEFT_RENDER_KERNELS_LIGHT_DRAWS_H

#include "render/kernels/shading_records.h"
#include "shading/dialect.h"
#include "shading/fibre_angle.h"

SHARED_BEGIN

// Beyond any scene.
const float kInfinitelyFarMm = 1e30f;

// Local coordinates to a frame whose z axis is `normal` (Duff et al. 2017, "Building an Orthonormal
// Basis, Revisited").
SHARED vec3 from_local(vec3 local, vec3 normal) {
  float side = normal.z < 0.0f ? -1.0f : 1.0f;
  float a = -1.0f / (side + normal.z);
  float b = normal.x * normal.y * a;
  vec3 x = vec3(1.0f + side * normal.x * normal.x * a, side * b, -side * normal.x);
  vec3 y = vec3(b, side + normal.y * normal.y * a, -normal.y);
  return local.x * x + local.y * y + local.z * normal;
}

// Cosine and sine of 2 pi u.
SHARED vec2 cos_sin_of_turn(float u) { return cos_sin_half(kTwoPi * (u < 0.5f ? u : u - 1.0f)); }

// A direction of density G / M: 1 - cos(theta) = -log(1 - u (1 - e^(-2 lambda))) / lambda.
SHARED vec3 sample_gaussian(vec3 axis, float lambda, float u1, float u2) {
  float fall = 2.0f * u1;
  if (lambda > 1e-4f) {
    fall = min(-log(1.0f - u1 * (1.0f - exp(-2.0f * lambda))) / lambda, 2.0f);
  }
  float sin_theta = sqrt(max(0.0f, fall * (2.0f - fall)));
  vec2 turn = cos_sin_of_turn(u2);
  return normalize(from_local(vec3(sin_theta * turn.x, sin_theta * turn.y, 1.0f - fall), axis));
}

// Light that arrives at a point from a drawn direction; `weight` is radiance over density, zero for
// a useless draw.
struct LightDraw {
  vec3 direction;  // unit, to the light
  float distance_mm;
  vec3 weight;
  float pdf;  // per steradian; 0 for lights of one direction, which no ray meets by chance
};

SHARED LightDraw draw_towards(vec3 from_mm, vec3 to_mm) {
  LightDraw drawn;
  vec3 way = to_mm - from_mm;
  drawn.distance_mm = length(way);
  drawn.direction = drawn.distance_mm > 0.0f ? way / drawn.distance_mm : vec3(0.0f, 0.0f, 1.0f);
  drawn.weight = vec3(0.0f, 0.0f, 0.0f);
  drawn.pdf = 0.0f;
  return drawn;
}

SHARED LightDraw draw_on_surface(vec3 from_mm, vec3 to_mm, vec3 normal, float area_mm2,
                                 vec3 radiance) {
  LightDraw drawn = draw_towards(from_mm, to_mm);
  float cos_light = -dot(drawn.direction, normal);
  if (cos_light > 0.0f && drawn.distance_mm > 0.0f) {
    drawn.pdf = drawn.distance_mm * drawn.distance_mm / (cos_light * area_mm2);
    drawn.weight = radiance / drawn.pdf;
  }
  return drawn;
}

SHARED LightDraw draw_light(DeviceLight light, vec3 point_mm, float u1, float u2) {
  if (light.kind == kLightRectangle) {
    vec3 normal = cross(light.edge_a, light.edge_b);
    float area_mm2 = length(normal);
    return draw_on_surface(point_mm, light.place + u1 * light.edge_a + u2 * light.edge_b,
                           normal / area_mm2, area_mm2, light.colour);
  }
  if (light.kind == kLightDisc) {
    float radius = light.sharpness * sqrt(u1);
    vec2 turn = cos_sin_of_turn(u2);
    vec3 to = light.place + from_local(vec3(radius * turn.x, radius * turn.y, 0.0f), light.edge_a);
    return draw_on_surface(point_mm, to, light.edge_a, kPi * light.sharpness * light.sharpness,
                           light.colour);
  }
  if (light.kind == kLightPoint) {
    LightDraw drawn = draw_towards(point_mm, light.place);
    if (drawn.distance_mm > 0.0f) {
      drawn.weight = light.colour / (drawn.distance_mm * drawn.distance_mm);
    }
    return drawn;
  }
  LightDraw drawn;
  drawn.direction = light.place;
  drawn.distance_mm = kInfinitelyFarMm;
  drawn.weight = light.colour;
  drawn.pdf = 0.0f;
  return drawn;
}

SHARED_END

#endif
