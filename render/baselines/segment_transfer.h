#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "render/fabric.h"
#include "shading/spherical_harmonics.h"

namespace weft::render {

struct PrtSettings {
  std::uint32_t sh_order = 5;
  std::uint64_t paths = 8192;  // per segment
  std::uint64_t seed = 1;
};

// Transfer matrices in the sense of standard PRT (Sloan, Kautz and Snyder 2002), as Khungurn et al.
// 2017, section 6.2, compare with: one for every segment and not for a cell of them, and of all
// light that arrives at its midpoint, the direct one included. Each is made when it is first asked
// for and kept. Any thread may ask.
class SegmentTransfer {
 public:
  // Every matrix takes 15 KB at order 5.
  static constexpr std::size_t kMostSegments = 16384;

  // Keeps a reference to `fabric`, which must outlive it.
  SegmentTransfer(const Fabric& fabric, const PrtSettings& settings);

  // c_T = A c_light, per channel. Throws core::Error(kResourceExhausted) when more than
  // kMostSegments segments are asked for.
  [[nodiscard]] std::array<shading::ShVector, 3> transferred(std::uint32_t segment,
                                                             const shading::ShVector& c_light);

 private:
  struct Matrix {
    std::once_flag made;
    std::vector<float> entries;  // [3, coefficients (j1), coefficients (j0)]
  };
  [[nodiscard]] Matrix& matrix_of(std::uint32_t segment);
  void make(std::uint32_t segment, Matrix& matrix) const;

  const Fabric& fabric_;
  PrtSettings settings_;
  std::mutex mutex_;
  std::unordered_map<std::uint32_t, std::unique_ptr<Matrix>> matrices_;  // under mutex_
};

}  // namespace weft::render
