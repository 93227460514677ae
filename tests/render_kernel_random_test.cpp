#include <gtest/gtest.h>

#include "core/random.h"
#include "render/kernels/random.h"

namespace weft::render {
namespace {

TEST(KernelRandom, DrawsTheWordsOfTheRenderersStreams) {
  for (const std::uint64_t seed : {std::uint64_t{0}, std::uint64_t{1}, 0xfedcba9876543210U}) {
    for (const std::uint32_t pixel : {0U, 7U, 0xffffffffU}) {
      for (const std::uint32_t sample : {0U, 1U, 123456U}) {
        core::Random random(seed, pixel, sample);
        const shading::RandomStream stream{
            {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)},
            pixel,
            sample};
        for (std::uint32_t block = 0; block < 5; ++block) {
          const glm::uvec4 words = shading::random_words(stream, block);
          for (int k = 0; k < 4; ++k) {
            EXPECT_EQ(words[k], random.bits());
          }
        }
      }
    }
  }
}

TEST(KernelRandom, PlacesEyeRaysWhereTheRendererDoes) {
  core::Random random(42, 1000, 3);
  const double x = random.uniform_double();
  const double y = random.uniform_double();
  const glm::vec4 u = shading::random_uniforms({{42, 0}, 1000, 3}, shading::kEyeBlock);
  EXPECT_NEAR(static_cast<double>(u.x), x, 6e-8);
  EXPECT_NEAR(static_cast<double>(u.z), y, 6e-8);
}

TEST(KernelRandom, UniformNumbersStayBelowOne) {
  EXPECT_LT(shading::uniform_of(0xffffffffU), 1.0f);
  EXPECT_EQ(shading::uniform_of(0), 0.0f);
}

}  // namespace
}  // namespace weft::render
