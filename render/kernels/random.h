// Shared text (C++20 and GLSL): counter-based random numbers, Philox4x32-10 (Salmon et al. 2011),
// the streams of core/random.h: what is drawn depends on the seed, the pixel, the sample and the
// place of the number alone.
#ifndef WEFT_RENDER_KERNELS_RANDOM_H
#define WEFT_RENDER_KERNELS_RANDOM_H

#include "shading/dialect.h"

SHARED_BEGIN

// The upper half of a 32-bit product.
SHARED uint multiply_high(uint a, uint b) {
  uint a_low = a & 0xffffu;
  uint a_high = a >> 16;
  uint b_low = b & 0xffffu;
  uint b_high = b >> 16;
  uint middle = a_high * b_low + ((a_low * b_low) >> 16);
  uint carried = a_low * b_high + (middle & 0xffffu);
  return a_high * b_high + (middle >> 16) + (carried >> 16);
}

// Philox4x32 with ten rounds.
SHARED uvec4 philox(uvec4 counter, uvec2 key) {
  uvec4 c = counter;
  uvec2 k = key;
  for (int i = 0; i < 10; ++i) {
    uint high_0 = multiply_high(0xD2511F53u, c.x);
    uint high_1 = multiply_high(0xCD9E8D57u, c.z);
    c = uvec4(high_1 ^ c.y ^ k.x, 0xCD9E8D57u * c.z, high_0 ^ c.w ^ k.y, 0xD2511F53u * c.x);
    k = uvec2(k.x + 0x9E3779B9u, k.y + 0xBB67AE85u);
  }
  return c;
}

// A stream of random numbers: those of one sample of one pixel. `key` is the seed, low word first.
struct RandomStream {
  uvec2 key;
  uint pixel;
  uint sample_index;
};

// The four words 4 block ... 4 block + 3 of a stream, as core::Random(seed, pixel, sample) draws
// them.
SHARED uvec4 random_words(RandomStream stream, uint block) {
  return philox(uvec4(block, stream.pixel, stream.sample_index, 0u), stream.key);
}

// Uniform in [0, 1), 24 bits.
SHARED float uniform_of(uint word) { return float(word >> 8) * 5.9604644775390625e-8f; }

SHARED vec4 random_uniforms(RandomStream stream, uint block) {
  uvec4 words = random_words(stream, block);
  return vec4(uniform_of(words.x), uniform_of(words.y), uniform_of(words.z), uniform_of(words.w));
}

// Which numbers of a sample's stream are for what. The eye ray takes block 0: its place in the
// pixel is (uniform_of(x), uniform_of(z)), core::Random::uniform_double() rounded down to 24 bits.
const uint kEyeBlock = 0u;
const uint kFirstLightBlock = 16u;
const uint kBlocksPerLight = 256u;

// Block `k` of those of a light.
SHARED uint light_block(int light, int k) {
  return kFirstLightBlock + uint(light) * kBlocksPerLight + uint(k);
}

SHARED_END

#endif
