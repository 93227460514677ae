// Adds the samples of a batch to the sums of their pixels, in the order of the samples, so that the
// sums do not depend on how the samples were spread over batches.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "render/kernels/batch.glsl"

layout(set = 0, binding = 0, scalar) readonly buffer HitBuffer { DeviceHit hits[]; };
layout(set = 0, binding = 1, scalar) readonly buffer SampleBuffer { DeviceSample samples[]; };
layout(set = 0, binding = 2, scalar) buffer PixelBuffer { DevicePixel pixels[]; };

// What rounding cuts off a + b (Knuth's two-sum).
precise vec3 rounding_of(vec3 a, vec3 b, vec3 sum) {
  precise vec3 b_rounded = sum - a;
  precise vec3 a_rounded = sum - b_rounded;
  precise vec3 rounding = (a - a_rounded) + (b - b_rounded);
  return rounding;
}

void main() {
  int columns = call.batch.columns;
  int k = int(gl_GlobalInvocationID.x);
  if (k >= columns * call.batch.rows) {
    return;
  }
  int row = call.batch.top - call.batch.band_top + k / columns;
  int pixel = row * call.batch.width + call.batch.left + k % columns;
  DevicePixel sums = pixels[pixel];
  for (int i = 0; i < call.batch.sample_count; ++i) {
    int item = k * call.batch.sample_count + i;
    DeviceHit hit = hits[item];
    if (hit.fate == kHitNothing) {
      ++sums.on_nothing;
    }
    if (call.batch.first_sample + i == 0) {
      sums.cloth = hit.cloth;
      sums.fabric = hit.fabric;
      sums.place = hit.place;
      sums.segment = hit.fate == kHitFibre ? hit.segment : -1;
    }
    if (hit.fate != kHitFibre) {
      continue;
    }
    ++sums.on_cloth;
    DeviceSample seen = samples[item];
    vec3 radiance = seen.single + seen.multiple;
    vec3 shadow = vec3(seen.arriving > 0.0f ? seen.through / seen.arriving : 0.0f);
    precise vec3 single = sums.single + seen.single;
    sums.single_rest += rounding_of(sums.single, seen.single, single);
    sums.single = single;
    precise vec3 multiple = sums.multiple + seen.multiple;
    sums.multiple_rest += rounding_of(sums.multiple, seen.multiple, multiple);
    sums.multiple = multiple;
    vec3 square = radiance * radiance;
    precise vec3 squared = sums.squared + square;
    sums.squared_rest += rounding_of(sums.squared, square, squared);
    sums.squared = squared;
    precise vec3 shadows = vec3(sums.shadow) + shadow;
    sums.shadow_rest += rounding_of(vec3(sums.shadow), shadow, shadows).x;
    sums.shadow = shadows.x;
  }
  pixels[pixel] = sums;
}
