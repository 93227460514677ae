#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/sandbox_child.h"
#include "render/image.h"

namespace weft::render {

inline constexpr const char* kExrRequest = "exr";
// An OpenEXR file may be so long, and hold so many pixels: a million and 256 for each of its bytes,
// and never more than the limit.
inline constexpr std::uint64_t kExrLimitBytes = std::uint64_t{2} << 30;
inline constexpr std::uint64_t kImagePixelLimit = std::uint64_t{1} << 27;
[[nodiscard]] std::uint64_t exr_pixel_limit(std::uint64_t file_bytes);

// Reads with OpenEXR in this very process: for the sandbox, and for who tests the parser. Throws as
// read_exr, and kResourceExhausted for more pixels than exr_pixel_limit.
[[nodiscard]] Image parse_exr(std::string_view bytes, const std::string& name,
                              std::string_view layer);

// The sandbox's half of read_exr: the layer is the request's argument.
[[nodiscard]] core::SandboxHandler exr_handler();
// What the handler hands back. Throws core::Error(kDataLoss) when it is not whole.
[[nodiscard]] Image image_from(core::FlatReader answer);

}  // namespace weft::render
