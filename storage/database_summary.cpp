#include "storage/database_summary.h"

#include <algorithm>
#include <cmath>

#include "core/half.h"

namespace weft::storage {

namespace {

double root_mean_square(const std::vector<float>& values) {
  double sum = 0;
  for (const float value : values) {
    sum += static_cast<double>(value) * static_cast<double>(value);
  }
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

}  // namespace

DatabaseErrors database_errors(const FabricDatabase& database) {
  DatabaseErrors errors;
  errors.transfer_rms = root_mean_square(database.transfer);
  errors.standard_error_rms = root_mean_square(database.transfer_se);
  if (!database.cell_paths.empty()) {
    const auto [fewest, most] =
        std::minmax_element(database.cell_paths.begin(), database.cell_paths.end());
    errors.fewest_paths = *fewest;
    errors.most_paths = *most;
  }
  double open = 0;
  std::size_t blocked = 0;
  for (const std::uint16_t half : database.open_share) {
    const double share = core::float_from_half(half);
    open += share;
    blocked += share == 0 ? 1 : 0;
  }
  if (!database.open_share.empty()) {
    const auto segments = static_cast<double>(database.open_share.size());
    errors.mean_open_share = open / segments;
    errors.blocked_share = static_cast<double>(blocked) / segments;
  }
  return errors;
}

}  // namespace weft::storage
