#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>

#include "storage/h5.h"

namespace weft::storage {

// One dataset of schema 1. `extents` names its shape: numbers are fixed, names stand for counts
// that are equal wherever the name occurs ("segments, components").
struct DatasetSpec {
  const char* path;
  h5::Element element;
  const char* extents;
  bool compress;
  h5::Caption caption;
  bool is_optional = false;  // older files do not have it
};

struct GroupSpec {
  const char* path;
  const char* description;
};

// In the order in which they are written.
[[nodiscard]] std::span<const DatasetSpec> dataset_specs();
[[nodiscard]] std::span<const GroupSpec> group_specs();
// REQUIRES: the schema has this dataset.
[[nodiscard]] const DatasetSpec& dataset_spec(std::string_view path);

// The counts that the names in DatasetSpec::extents stand for.
class Extents {
 public:
  void set(const std::string& name, std::uint64_t count) { counts_[name] = count; }
  // REQUIRES: set or bound before.
  [[nodiscard]] std::uint64_t at(const std::string& name) const;
  // The shape of a dataset. REQUIRES: all its names are known.
  [[nodiscard]] h5::Shape shape_of(const DatasetSpec& spec) const;
  // Takes counts from the shape that a file has. Throws core::Error(kDataLoss) naming the dataset
  // when the shape contradicts the schema or a dataset bound before.
  void bind(const DatasetSpec& spec, const h5::Shape& shape);

 private:
  std::map<std::string, std::uint64_t> counts_;
};

}  // namespace weft::storage
