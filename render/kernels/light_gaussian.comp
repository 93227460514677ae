// Adds a spherical Gaussian light to the hits of a batch (Khungurn et al. 2017, section 5.2.2): it is
// shaded as if distant cloth blocked none of it, and counts where a drawn direction of it reaches
// the surface.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "render/kernels/lit_hit.glsl"

// That share is of the light above the fabric's own horizon: what is below counts nothing in the
// shading already. `part`: 0 for single, 1 for multiple scattering.
bool is_lit(LitHit at, DeviceLight light, vec3 from_mm, int part) {
  for (int k = 0; k < kMaxDraws; ++k) {
    vec4 u = uniforms_for(at, kDirectionBlock + part * kMaxDraws + k);
    vec3 direction = sample_gaussian(light.place, light.sharpness, u.x, u.y);
    if ((at.to_flat * direction).z > 0.0f) {
      bool cut = light.cut_at_horizon != 0 && direction.z < 0.0f;
      return !cut && reaches(at, from_mm, direction, kInfinitelyFarMm);
    }
  }
  return false;
}

void main() {
  uint item = gl_GlobalInvocationID.x;
  if (item >= batch_items(call.batch) || !is_of_call(hits[item])) {
    return;
  }
  LitHit at = lit_hit(hits[item], item);
  DeviceLight light = lights[call.light];
  SphericalGaussian local;
  local.axis = normalize(at.to_flat * light.place);
  local.sharpness = light.sharpness;
  start_sample(item);
  // Both parts in one loop: a compiler that inlines the shadow ray inlines it once.
  bool lit[2] = bool[2](false, false);
  vec3 from_mm = top_of(at);
  for (int part = 0; part < 2; ++part) {
    if (wants(call, part == 0 ? kWantSingle | kWantShadow : kWantMultiple)) {
      from_mm = part == 0 ? from_mm : neighbour_of(at, from_mm);
      lit[part] = is_lit(at, light, from_mm, part);
    }
  }
  if (lit[0] && wants(call, kWantSingle)) {
    GaussianShading how;
    how.blend_low = call.blend_low;
    how.blend_high = call.blend_high;
    how.gamma_method = call.gamma_method;
    samples[item].single +=
        single_gaussian(kFabric, at.hit.segment, at.seen, at.lobes, local, how) * light.colour;
  }
  float brought = light.colour.x + light.colour.y + light.colour.z;
  samples[item].arriving += brought;
  samples[item].through += lit[0] ? brought : 0.0f;
  if (wants(call, kWantMultiple)) {
    vec3 irradiance = lit[1] ? light.colour : vec3(0.0f);
    if (lit[1] || call.is_first != 0) {
      ShVector c_light = sh_zero();
      if (call.transferred == 0) {
        c_light = harmonics_of_gaussian(local);
      }
      add_arriving(item, at.hit.segment, irradiance, c_light);
    }
  }
}
