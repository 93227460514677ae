#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/sandbox_child.h"
#include "render/png.h"

namespace weft::render {

inline constexpr const char* kPngRequest = "png";
inline constexpr std::uint64_t kPngLimitBytes = std::uint64_t{64} << 20;

// Reads with libpng in this very process: for the sandbox, and for who tests the parser. Throws as
// read_plain_png.
[[nodiscard]] PlainPicture parse_plain_png(std::string_view bytes, const std::string& name,
                                           std::uint32_t side_limit);

// The sandbox's half of read_plain_png: the limit is the request's argument.
[[nodiscard]] core::SandboxHandler png_handler();
// What the handler hands back. Throws core::Error(kDataLoss) when it is not whole.
[[nodiscard]] PlainPicture plain_picture_from(core::FlatReader answer, std::uint32_t side_limit);

}  // namespace weft::render
