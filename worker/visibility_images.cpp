#include "worker/visibility_images.h"

#include <algorithm>

#include "core/error.h"
#include "proto/arrays.h"

namespace weft::worker {

VisibilityImages::VisibilityImages(const std::string& result, std::uint32_t resolution)
    : bytes_per_image_(std::size_t{resolution} * resolution / 8) {
  std::vector<std::uint64_t> shape;
  bits_ = v1::array_of<std::uint8_t>(v1::parse_arrays(result), "bits", &shape);
  if (shape.size() != 2 || shape[1] != bytes_per_image_) {
    throw core::Error(core::Code::kDataLoss, "the visibility result is not of resolution " +
                                                 std::to_string(resolution) +
                                                 "; its stage must have the same setting");
  }
}

bool is_uniform(std::span<const std::uint8_t> image) {
  const auto all = [&](std::uint8_t value) {
    return std::all_of(image.begin(), image.end(), [&](std::uint8_t b) { return b == value; });
  };
  return all(0x00) || all(0xff);
}

}  // namespace weft::worker
