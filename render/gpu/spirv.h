#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace weft::render::gpu {

// What can be read off a SPIR-V module without a device. REQUIRES: valid modules.

// One more than the highest binding it uses.
[[nodiscard]] std::uint32_t spirv_buffer_count(std::span<const std::uint32_t> words);
// The numbers of the capabilities it needs; 1 is Shader.
[[nodiscard]] std::vector<std::uint32_t> spirv_capabilities(std::span<const std::uint32_t> words);

}  // namespace weft::render::gpu
