#pragma once

#include <cstdint>
#include <span>

namespace weft::render::gpu {

// A shader: SPIR-V words, embedded at build time. Each render/kernels/NAME.comp is declared in the
// generated render/gpu/kernels.h as weft::render::gpu::kernels::NAME.
struct KernelCode {
  const char* name;  // of the .comp file
  std::span<const std::uint32_t> words;
};

}  // namespace weft::render::gpu
