#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace weft::worker {

// The images in one visibility result.
class VisibilityImages {
 public:
  // Throws core::Error(kDataLoss) when the bytes are not a result of that resolution.
  VisibilityImages(const std::string& result, std::uint32_t resolution);

  [[nodiscard]] std::size_t count() const { return bits_.size() / bytes_per_image_; }
  [[nodiscard]] std::span<const std::uint8_t> image(std::size_t i) const {
    return std::span(bits_).subspan(i * bytes_per_image_, bytes_per_image_);
  }

 private:
  std::size_t bytes_per_image_;
  std::vector<std::uint8_t> bits_;
};

// Whether all directions of an image are alike: nothing is seen, or everything.
[[nodiscard]] bool is_uniform(std::span<const std::uint8_t> image);

}  // namespace weft::worker
