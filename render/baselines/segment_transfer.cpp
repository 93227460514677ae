#include "render/baselines/segment_transfer.h"

#include <string>

#include "core/error.h"
#include "core/moments.h"
#include "transport/transfer.h"

namespace weft::render {

SegmentTransfer::SegmentTransfer(const Fabric& fabric, const PrtSettings& settings)
    : fabric_(fabric), settings_(settings) {}

SegmentTransfer::Matrix& SegmentTransfer::matrix_of(std::uint32_t segment) {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::unique_ptr<Matrix>& matrix = matrices_[segment];
  if (!matrix) {
    if (matrices_.size() > kMostSegments) {
      throw core::Error(core::Code::kResourceExhausted,
                        "more than " + std::to_string(kMostSegments) +
                            " segments are in the picture, each of which needs a transfer matrix "
                            "of its own; draw a smaller crop");
    }
    matrix = std::make_unique<Matrix>();
  }
  return *matrix;
}

void SegmentTransfer::make(std::uint32_t segment, Matrix& matrix) const {
  transport::TransferSettings settings;
  settings.sh_order = settings_.sh_order;
  settings.seed = settings_.seed;
  settings.with_direct = true;
  const transport::CellSegments only{{segment}, {}};
  transport::CellPaths paths;
  paths.cell = segment;
  paths.segments = &only;
  paths.count = settings_.paths;
  const transport::TransferSums sums =
      transport::transfer_sums(fabric_.scene(), fabric_.bcsdfs(), paths, settings);
  matrix.entries.reserve(sums.sum.size());
  for (const std::int64_t sum : sums.sum) {
    matrix.entries.push_back(
        static_cast<float>(core::from_fixed_point(sum) / static_cast<double>(settings_.paths)));
  }
}

std::array<shading::ShVector, 3> SegmentTransfer::transferred(std::uint32_t segment,
                                                              const shading::ShVector& c_light) {
  Matrix& matrix = matrix_of(segment);
  std::call_once(matrix.made, [&] { make(segment, matrix); });
  const std::size_t n =
      (std::size_t{settings_.sh_order} + 1) * (std::size_t{settings_.sh_order} + 1);
  std::array<shading::ShVector, 3> c_t{shading::sh_zero(), shading::sh_zero(), shading::sh_zero()};
  const float* row = matrix.entries.data();
  for (shading::ShVector& channel : c_t) {
    for (std::size_t j1 = 0; j1 < n; ++j1, row += n) {
      for (std::size_t j0 = 0; j0 < n; ++j0) {
        channel.c[j1] += row[j0] * c_light.c[j0];
      }
    }
  }
  return c_t;
}

}  // namespace weft::render
