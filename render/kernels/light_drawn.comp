// Adds a light to the hits of a batch by one direction towards it: directional and point lights as
// they are, rectangles and discs by a point drawn on them (Khungurn et al. 2017, section 5.2.1).
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "render/kernels/lit_hit.glsl"

void main() {
  uint item = gl_GlobalInvocationID.x;
  if (item >= batch_items(call.batch) || !is_of_call(hits[item])) {
    return;
  }
  LitHit at = lit_hit(hits[item], item);
  DeviceLight light = lights[call.light];
  vec4 u = uniforms_for(at, kDirectionBlock);
  LightDraw drawn = draw_light(light, at.hit.world_mm, u.x, u.y);
  vec3 omega_d = normalize(at.to_flat * drawn.direction);
  bool above = omega_d.z > 0.0f && drawn.weight != vec3(0.0f);
  start_sample(item);
  bool lit[2] = bool[2](false, false);
  vec3 single = vec3(0.0f);
  if (above && wants(call, kWantSingle)) {
    single = single_directional(kFabric, at.hit.segment, at.seen, at.lobes, omega_d);
  }
  vec3 from_mm = top_of(at);
  for (int part = 0; part < 2 && above; ++part) {
    bool wanted = part == 0 ? single != vec3(0.0f) || wants(call, kWantShadow)
                            : wants(call, kWantMultiple);
    if (wanted) {
      from_mm = part == 0 ? from_mm : neighbour_of(at, from_mm);
      lit[part] = reaches(at, from_mm, drawn.direction, drawn.distance_mm);
    }
  }
  if (lit[0]) {
    samples[item].single += single * drawn.weight;
  }
  float brought = above ? drawn.weight.x + drawn.weight.y + drawn.weight.z : 0.0f;
  samples[item].arriving += brought;
  samples[item].through += lit[0] ? brought : 0.0f;
  if (wants(call, kWantMultiple) && (lit[1] || call.is_first != 0)) {
    ShVector c_light = sh_zero();
    if (call.transferred == 0) {
      c_light = harmonics_of_direction(omega_d);
    }
    add_arriving(item, at.hit.segment, lit[1] ? drawn.weight : vec3(0.0f), c_light);
  }
}
