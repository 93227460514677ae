// What every kernel that shades is told, and which item an invocation works on.
#ifndef WEFT_RENDER_KERNELS_BATCH_GLSL
#define WEFT_RENDER_KERNELS_BATCH_GLSL

#include "render/kernels/hit.h"
#include "render/kernels/random.h"
#include "render/kernels/shading_records.h"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform Push { ShadingCall call; };

RandomStream stream_of_item(uint item) {
  int samples = call.batch.sample_count;
  int pixel = int(item) / samples;
  int x = call.batch.left + pixel % call.batch.columns;
  int y = call.batch.top + pixel / call.batch.columns;
  RandomStream stream;
  stream.key = call.batch.seed;
  stream.pixel = uint(y * call.batch.width + x);
  stream.sample_index = uint(call.batch.first_sample + int(item) % samples);
  return stream;
}

// Whether the hit is of the piece of cloth and the fabric that this call shades.
bool is_of_call(DeviceHit hit) {
  return hit.fate == kHitFibre && hit.cloth == call.cloth && hit.fabric == call.fabric;
}

// Where entry (channel, j) of what arrives at an item is held: neighbours lie side by side.
uint arriving_index(uint item, int channel, int j, int harmonics) {
  return uint(channel * harmonics + j) * call.batch.capacity + item;
}

#endif
