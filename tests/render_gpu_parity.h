#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/random.h"
#include "render/gpu/device.h"
#include "tests/shading_fibres.h"

// The host's side of tests/kernels/parity_cases.h.

namespace weft::shading {

[[nodiscard]] inline FibreLobes parity_lobes(int material) {
  return published(static_cast<std::size_t>(material)).lobes();
}

}  // namespace weft::shading

#include "tests/kernels/parity_cases.h"

namespace weft::render::gpu {

// FibreLobes as a kernel has them: the table is the index of its first entry.
struct ParityMaterial {
  glm::vec3 c_r;
  glm::vec3 c_tt;
  float precision_r;
  float precision_tt;
  float kappa_tt;
  float azimuth_norm;
  std::int32_t table;
};

// Inputs over the whole range of every function: directions at the poles, along the axes, grazing,
// equal and opposite; sharpness from 1e-3 to 1e5 and at the borders between formulas.
class ParityInputs {
 public:
  [[nodiscard]] std::vector<shading::ParityInput> make(std::size_t count) {
    std::vector<shading::ParityInput> inputs(count);
    for (shading::ParityInput& x : inputs) {
      x.a = direction();
      x.b = chance(0.25F) ? near(x.a) : direction();
      x.c = chance(0.25F) ? near(x.b) : direction();
      x.sharpness_a = sharpness();
      x.sharpness_b = chance(0.2F) ? x.sharpness_a : sharpness();
      for (float& u : x.unit) {
        u = chance(0.05F) ? 0.0F : random_.uniform();
      }
      x.material = static_cast<int>(random_.below(4));
      x.count = static_cast<int>(random_.below(1000));
    }
    return inputs;
  }

 private:
  [[nodiscard]] bool chance(float share) { return random_.uniform() < share; }
  [[nodiscard]] float signed_unit() { return 2 * random_.uniform() - 1; }

  [[nodiscard]] glm::vec3 uniform_direction() {
    while (true) {
      const glm::vec3 v(signed_unit(), signed_unit(), signed_unit());
      const float length2 = glm::dot(v, v);
      if (length2 > 1e-3F && length2 < 1) {
        return v / std::sqrt(length2);
      }
    }
  }
  // Equal, opposite, or apart by 1e-7 to 1e-1.
  [[nodiscard]] glm::vec3 near(glm::vec3 axis) {
    const glm::vec3 to = chance(0.4F) ? -axis : axis;
    if (chance(0.3F)) {
      return to;
    }
    const float apart = std::pow(10.0F, -7 + 6 * random_.uniform());
    return glm::normalize(to + apart * uniform_direction());
  }
  [[nodiscard]] glm::vec3 direction() {
    if (chance(0.6F)) {
      return uniform_direction();
    }
    glm::vec3 axis(0);
    axis[static_cast<int>(random_.below(3))] = 1;
    return near(axis);
  }
  [[nodiscard]] float sharpness() {
    constexpr std::array<float, 8> kBorders{1e-3F, 0.25F, 3.75F, 10, 48, 100, 200, 1e5F};
    return chance(0.2F) ? kBorders[random_.below(8)] : std::pow(10.0F, -3 + 8 * random_.uniform());
  }

  core::Random random_{20170703, 0};
};

// What the device makes of the inputs.
[[nodiscard]] inline std::vector<shading::ParityOutput> parity_on_device(
    Device& device, const KernelCode& code, int which,
    const std::vector<shading::ParityInput>& inputs) {
  std::vector<ParityMaterial> materials;
  std::vector<glm::vec2> entries;
  for (int m = 0; m < 4; ++m) {
    const shading::FibreLobes lobes = shading::parity_lobes(m);
    materials.push_back({lobes.c_r, lobes.c_tt, lobes.precision_r, lobes.precision_tt,
                         lobes.kappa_tt, lobes.azimuth_norm,
                         static_cast<std::int32_t>(entries.size())});
    entries.insert(entries.end(), lobes.table, lobes.table + shading::kLobeTableCells + 1);
  }
  const Buffer in = device.upload(inputs, "inputs");
  const Buffer out = device.allocate(inputs.size() * sizeof(shading::ParityOutput), "outputs");
  const Buffer of_materials = device.upload(materials, "materials");
  const Buffer of_entries = device.upload(entries, "tables");
  const std::vector<std::uint32_t> constants{static_cast<std::uint32_t>(which)};
  const Kernel kernel = device.make_kernel(code, 4, 4, constants);
  const auto count = static_cast<std::uint32_t>(inputs.size());
  const Dispatch dispatch{.kernel = &kernel,
                          .buffers = {&in, &out, &of_materials, &of_entries},
                          .push = push_constants(count),
                          .groups_x = (count + 63) / 64};
  (void)device.run({&dispatch, 1});
  return device.download<shading::ParityOutput>(out, inputs.size());
}

}  // namespace weft::render::gpu
