#include "render/gpu/spirv.h"

#include <algorithm>
#include <functional>

#include "core/check.h"

namespace weft::render::gpu {

namespace {

// Of the SPIR-V specification, version 1.5.
constexpr std::uint32_t kMagic = 0x07230203;
constexpr std::size_t kHeaderWords = 5;
constexpr std::uint32_t kOpCapability = 17;
constexpr std::uint32_t kOpDecorate = 71;
constexpr std::uint32_t kDecorationBinding = 33;

// Calls `visit(opcode, operands)` for each instruction.
void walk(std::span<const std::uint32_t> words,
          const std::function<void(std::uint32_t, std::span<const std::uint32_t>)>& visit) {
  CHECK_GT(words.size(), kHeaderWords);
  CHECK_EQ(words[0], kMagic);
  for (std::size_t at = kHeaderWords; at < words.size();) {
    const std::size_t length = words[at] >> 16;
    CHECK(length > 0 && length <= words.size() - at);
    visit(words[at] & 0xffffU, words.subspan(at + 1, length - 1));
    at += length;
  }
}

}  // namespace

std::uint32_t spirv_buffer_count(std::span<const std::uint32_t> words) {
  std::uint32_t count = 0;
  walk(words, [&count](std::uint32_t opcode, std::span<const std::uint32_t> operands) {
    if (opcode == kOpDecorate && operands.size() == 3 && operands[1] == kDecorationBinding) {
      count = std::max(count, operands[2] + 1);
    }
  });
  return count;
}

std::vector<std::uint32_t> spirv_capabilities(std::span<const std::uint32_t> words) {
  std::vector<std::uint32_t> found;
  walk(words, [&found](std::uint32_t opcode, std::span<const std::uint32_t> operands) {
    if (opcode == kOpCapability) {
      found.push_back(operands[0]);
    }
  });
  return found;
}

}  // namespace weft::render::gpu
