// Shading of one hit by one light: what comes of both kinds of scattering, and the shadow rays from
// the upper surface above the hit (Khungurn et al. 2017, section 5.3.2 and figure 5). The same
// estimators as render/precomputed_integrator.cpp.
#ifndef WEFT_RENDER_KERNELS_LIT_HIT_GLSL
#define WEFT_RENDER_KERNELS_LIT_HIT_GLSL

#include "render/kernels/batch.glsl"
#define SOLID_BINDING 0
#include "render/kernels/solid.glsl"
#define FABRIC_BINDING 5
#include "render/kernels/fabric_buffers.glsl"
#include "render/kernels/light_draws.h"
#include "shading/light_harmonics.h"
#include "shading/single_scattering.h"

layout(set = 0, binding = 11, scalar) readonly buffer HitBuffer { DeviceHit hits[]; };
layout(set = 0, binding = 12, scalar) readonly buffer LightBuffer { DeviceLight lights[]; };
layout(set = 0, binding = 13, scalar) buffer SampleBuffer { DeviceSample samples[]; };
// [3 channels, harmonics, capacity]: light that arrives, before its transfer or behind it.
layout(set = 0, binding = 14, scalar) buffer ArrivingBuffer { float arriving[]; };
// [cells, 3 channels, harmonics]: this light behind the transfer of every cell, when it is the same
// for all hits of a cell.
layout(set = 0, binding = 15, scalar) readonly buffer CellBuffer { float cell_radiance[]; };

// Draws that are given up: of a neighbour within the cloth, of a direction above its horizon.
const int kMaxDraws = 32;
// Blocks of random numbers: of directions, and of neighbours behind them.
const int kDirectionBlock = 0;
const int kNeighbourBlock = 2 * kMaxDraws;

struct LitHit {
  DeviceHit hit;
  RandomStream stream;
  mat3 to_flat;
  SeenFibre seen;
  FibreLobes lobes;
};

LitHit lit_hit(DeviceHit hit, uint item) {
  LitHit at;
  at.hit = hit;
  at.stream = stream_of_item(item);
  at.to_flat = rotation_at(kGeometry, hit.cloth, hit.place);
  at.seen = seen_fibre(device_segments[hit.segment].tangent, normalize(at.to_flat * hit.to_eye));
  at.lobes = lobes_of(material_of(hit.segment));
  return at;
}

vec4 uniforms_for(LitHit at, int block) {
  return random_uniforms(at.stream, light_block(call.light, block));
}

vec3 top_of(LitHit at) {
  TopPoint top = top_point(kGeometry, at.hit.cloth, at.hit.place, at.hit.flat_mm, vec2(0.0f));
  return top.exists ? top.world_mm : at.hit.world_mm;
}

// A point of the upper surface from the Gaussian about the hit that smooths the shadow of multiple
// scattering; points beyond the border are drawn again.
vec3 neighbour_of(LitHit at, vec3 top_mm) {
  float sigma_mm = device_fabric_sizes.sigma_shadow_mm;
  for (int k = 0; k < kMaxDraws && sigma_mm > 0.0f; ++k) {
    vec4 u = uniforms_for(at, kNeighbourBlock + k);
    float radius = sigma_mm * sqrt(-2.0f * log(1.0f - u.x));
    TopPoint top = top_point(kGeometry, at.hit.cloth, at.hit.place, at.hit.flat_mm,
                             radius * cos_sin_of_turn(u.y));
    if (top.exists) {
      return top.world_mm;
    }
  }
  return top_mm;
}

// Whether light reaches a point of the surface: from a direction, or from a point of the world that
// lies `distance_mm` from the hit.
bool reaches(LitHit at, vec3 from_mm, vec3 direction, float distance_mm) {
  if (distance_mm >= kInfinitelyFarMm) {
    return !blocked_by_cloth(kGeometry, call.cloths, from_mm, direction, kInfinitelyFarMm);
  }
  vec3 way = at.hit.world_mm + distance_mm * direction - from_mm;
  float length_mm = length(way);
  return length_mm > 0.0f &&
         !blocked_by_cloth(kGeometry, call.cloths, from_mm, way / length_mm, length_mm);
}

void start_sample(uint item) {
  if (call.is_first != 0) {
    samples[item].single = vec3(0.0f);
    samples[item].multiple = vec3(0.0f);
    samples[item].arriving = 0.0f;
    samples[item].through = 0.0f;
  }
}

// Adds light of the given irradiances to what arrives for multiple scattering. `c_light` is not
// read when the light's transfer is known for all cells.
void add_arriving(uint item, int segment, vec3 irradiance, ShVector c_light) {
  int harmonics = device_fabric_sizes.harmonics;
  int cell = int(device_segments[segment].cell);
  for (int channel = 0; channel < 3; ++channel) {
    for (int j = 0; j < harmonics; ++j) {
      uint at = arriving_index(item, channel, j, harmonics);
      float c = call.transferred != 0 ? cell_radiance[(cell * 3 + channel) * harmonics + j]
                                      : c_light.c[j];
      float before = call.is_first != 0 ? 0.0f : arriving[at];
      arriving[at] = before + irradiance[channel] * c;
    }
  }
}

#endif
