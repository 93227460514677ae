#include "storage/database_diff.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "core/half.h"
#include "storage/database_schema.h"
#include "storage/h5_reader.h"
#include "storage/user_block.h"

namespace weft::storage {

namespace {

constexpr std::uint64_t kBlockNumbers = std::uint64_t{1} << 16;

template <class T>
void append_as(std::span<const std::byte> bytes, std::vector<double>& values) {
  for (std::size_t at = 0; at + sizeof(T) <= bytes.size(); at += sizeof(T)) {
    T value{};
    std::memcpy(&value, bytes.data() + at, sizeof(T));
    values.push_back(static_cast<double>(value));
  }
}

std::vector<double> numbers_of(h5::Element element, std::span<const std::byte> bytes) {
  std::vector<double> values;
  switch (element) {
    case h5::Element::kU16:
      append_as<std::uint16_t>(bytes, values);
      break;
    case h5::Element::kU32:
      append_as<std::uint32_t>(bytes, values);
      break;
    case h5::Element::kU64:
      append_as<std::uint64_t>(bytes, values);
      break;
    case h5::Element::kI32:
      append_as<std::int32_t>(bytes, values);
      break;
    case h5::Element::kF16:
      append_as<std::uint16_t>(bytes, values);
      for (double& value : values) {
        value = core::float_from_half(static_cast<std::uint16_t>(value));
      }
      break;
    case h5::Element::kF32:
      append_as<float>(bytes, values);
      break;
    case h5::Element::kF64:
      append_as<double>(bytes, values);
      break;
    case h5::Element::kText:
      core::check_failed(__FILE__, __LINE__, "texts are no numbers");
  }
  return values;
}

std::optional<DatasetSource::Info> info_of(DatasetSource& file, const char* path) {
  try {
    return file.info(path);
  } catch (const core::Error&) {
    return std::nullopt;  // added to the schema after this file was made
  }
}

// One dataset, read.
struct Values {
  std::optional<DatasetSource::Info> info;
  std::vector<std::byte> bytes;
};

Values values_of(DatasetSource& file, const char* path) {
  Values values{info_of(file, path), {}};
  if (values.info) {
    file.admit(path, *values.info);
    values.bytes.resize(values.info->bytes);
    file.read(path, *values.info, values.bytes);
  }
  return values;
}

// By blocks: what is unpacked to doubles is small.
void compare_numbers(h5::Element from, std::span<const std::byte> a, h5::Element to,
                     std::span<const std::byte> b, std::uint64_t count,
                     DatasetDifference& difference) {
  const std::size_t width_a = a.size() / count;
  const std::size_t width_b = b.size() / count;
  double squares = 0;
  double squares_from = 0;
  for (std::uint64_t first = 0; first < count; first += kBlockNumbers) {
    const std::uint64_t taken = std::min(kBlockNumbers, count - first);
    const std::vector<double> values =
        numbers_of(from, a.subspan(first * width_a, taken * width_a));
    const std::vector<double> others = numbers_of(to, b.subspan(first * width_b, taken * width_b));
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double apart = std::abs(others[i] - values[i]);
      difference.largest = std::max(difference.largest, apart);
      squares += apart * apart;
      squares_from += values[i] * values[i];
    }
  }
  difference.rms = std::sqrt(squares / static_cast<double>(count));
  difference.rms_from = std::sqrt(squares_from / static_cast<double>(count));
}

DatasetDifference compare(const char* path, const Values& a, const Values& b) {
  DatasetDifference difference;
  difference.path = path;
  if (a.info) {
    difference.shape_from = a.info->shape;
  }
  if (b.info) {
    difference.shape_to = b.info->shape;
  }
  if (!a.info || !b.info || a.info->shape != b.info->shape) {
    return difference;
  }
  const h5::Element from = a.info->element;
  const h5::Element to = b.info->element;
  difference.is_equal = from == to && a.bytes == b.bytes;
  std::uint64_t count = 1;
  for (const std::uint64_t extent : a.info->shape) {
    count *= extent;
  }
  if (from != h5::Element::kText && to != h5::Element::kText && count > 0) {
    compare_numbers(from, a.bytes, to, b.bytes, count, difference);
  }
  return difference;
}

// The library takes two files that it reads from memory for one, so they are open one at a time.
void read_each(const std::filesystem::path& path,
               const std::function<void(const char* path, Values values)>& take) {
  const std::string bytes = core::read_file(path);
  h5::Reader file(std::as_bytes(std::span(bytes)), kUserBlockBytes);
  for (const DatasetSpec& spec : dataset_specs()) {
    take(spec.path, values_of(file, spec.path));
  }
}

}  // namespace

std::vector<DatasetDifference> diff_databases(const std::filesystem::path& from,
                                              const std::filesystem::path& to) {
  std::map<std::string, Values> first;
  read_each(from, [&](const char* path, Values values) { first[path] = std::move(values); });
  std::vector<DatasetDifference> differences;
  read_each(to, [&](const char* path, const Values& values) {
    differences.push_back(compare(path, first.at(path), values));
    first.erase(path);
  });
  return differences;
}

std::string description_json(const std::filesystem::path& path) {
  const std::string bytes = core::read_file(path);
  h5::Reader file(std::as_bytes(std::span(bytes)), kUserBlockBytes);
  const Values text = values_of(file, "/provenance/description");
  std::string json(text.bytes.size(), '\0');
  std::memcpy(json.data(), text.bytes.data(), json.size());
  return json.substr(0, json.find('\0'));
}

}  // namespace weft::storage
