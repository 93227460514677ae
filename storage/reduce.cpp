#include "storage/reduce.h"

#include <span>
#include <utility>
#include <vector>

#include "core/check.h"
#include "core/half.h"

namespace weft::storage {
namespace {

std::size_t sh_count(std::uint32_t order) {
  return (std::size_t{order} + 1) * (std::size_t{order} + 1);
}

// Rows of `row` entries, of which the first `kept` stay.
template <class T>
std::vector<T> first_of_rows(const std::vector<T>& rows, std::size_t row, std::size_t kept) {
  std::vector<T> result;
  result.reserve(rows.size() / row * kept);
  for (std::size_t at = 0; at < rows.size(); at += row) {
    result.insert(result.end(), rows.begin() + static_cast<std::ptrdiff_t>(at),
                  rows.begin() + static_cast<std::ptrdiff_t>(at + kept));
  }
  return result;
}

// Harmonics are ordered by degree: a lower order's matrix is the upper left corner.
std::vector<float> corners(const std::vector<float>& matrices, std::size_t n, std::size_t kept) {
  return first_of_rows(first_of_rows(matrices, n * n, n * kept), n, kept);
}

void round_to_half(std::span<float> values) {
  for (float& value : values) {
    value = core::float_from_half(core::half_from_float(value));
  }
}

}  // namespace

FabricDatabase with_sh_order(FabricDatabase database, std::uint32_t sh_order) {
  CHECK(sh_order <= database.sh_order);
  const std::size_t n = sh_count(database.sh_order);
  const std::size_t kept = sh_count(sh_order);
  database.transfer = corners(database.transfer, n, kept);
  database.transfer_se = corners(database.transfer_se, n, kept);
  database.c_s = first_of_rows(database.c_s, n, kept);
  database.sh_order = sh_order;
  return database;
}

FabricDatabase with_components(FabricDatabase database, std::uint32_t components) {
  CHECK(components <= database.pca_components);
  const std::size_t pixels =
      std::size_t{database.visibility_resolution} * database.visibility_resolution;
  database.ssdf_basis.resize(pixels * components);
  if (database.pca_components > 0) {
    database.ssdf = first_of_rows(database.ssdf, database.pca_components, components);
  }
  database.pca_components = components;
  return database;
}

FabricDatabase in_half_precision(FabricDatabase database) {
  round_to_half(database.transfer);
  round_to_half(database.c_s);
  round_to_half(database.ssdf_mean);
  round_to_half(database.ssdf_basis);
  return database;
}

}  // namespace weft::storage
