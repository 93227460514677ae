// The transfer matrices of some of a fabric's cells: define TRANSFER_BINDING and include this after
// fabric_buffers.glsl. [cells, 3 channels, columns, quads of rows], as pairs of halves or as floats.
#ifndef WEFT_RENDER_KERNELS_TRANSFER_BUFFERS_GLSL
#define WEFT_RENDER_KERNELS_TRANSFER_BUFFERS_GLSL

layout(set = 0, binding = TRANSFER_BINDING, scalar) readonly buffer TransferBuffer {
  uint transfer_words[];
};

// `cell` is counted from the first one that is bound.
vec4 transfer_rows(FabricTables t, int cell, int channel, int j0, int quad) {
  int entry = ((cell * 3 + channel) * device_fabric_sizes.harmonics + j0) * device_fabric_sizes.quads + quad;
  if (device_fabric_sizes.transfer_is_half != 0) {
    return vec4(unpackHalf2x16(transfer_words[2 * entry]),
                unpackHalf2x16(transfer_words[2 * entry + 1]));
  }
  return vec4(uintBitsToFloat(transfer_words[4 * entry]),
              uintBitsToFloat(transfer_words[4 * entry + 1]),
              uintBitsToFloat(transfer_words[4 * entry + 2]),
              uintBitsToFloat(transfer_words[4 * entry + 3]));
}

#include "shading/multiple_scattering.h"

#endif
