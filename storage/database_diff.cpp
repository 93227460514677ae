#include "storage/database_diff.h"

#include <algorithm>
#include <cmath>
#include <cstring>
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

constexpr std::uint64_t kPartBytes = std::uint64_t{16} << 20;    // of a dataset, at a time
constexpr std::uint64_t kBlockNumbers = std::uint64_t{1} << 16;  // unpacked to doubles

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

// A database whose datasets are read in parts. The library takes two files that it reads from
// memory for one, so each is open for one part at a time only.
class ClosedDatabase {
 public:
  explicit ClosedDatabase(const std::filesystem::path& path) : bytes_(core::read_file(path)) {}

  [[nodiscard]] std::optional<DatasetSource::Info> info(const char* path) const {
    h5::Reader file = open();
    return info_of(file, path);
  }
  [[nodiscard]] std::vector<std::byte> rows(const char* path, const DatasetSource::Info& info,
                                            std::uint64_t first, std::uint64_t count) const {
    std::vector<std::byte> values(info.bytes / info.shape.front() * count);
    open().read_rows(path, info, first, count, values);
    return values;
  }

 private:
  [[nodiscard]] h5::Reader open() const {
    return h5::Reader(std::as_bytes(std::span(bytes_)), kUserBlockBytes,
                      h5::Decoding::kByAllThreads);
  }

  std::string bytes_;
};

// Of numbers, taken in any parts.
class Comparison {
 public:
  void add(h5::Element from, std::span<const std::byte> a, std::uint64_t width_a, h5::Element to,
           std::span<const std::byte> b, std::uint64_t width_b) {
    const std::uint64_t count = a.size() / width_a;
    for (std::uint64_t first = 0; first < count; first += kBlockNumbers) {
      const std::uint64_t taken = std::min(kBlockNumbers, count - first);
      add(numbers_of(from, a.subspan(first * width_a, taken * width_a)),
          numbers_of(to, b.subspan(first * width_b, taken * width_b)));
    }
  }
  void finish(DatasetDifference& difference) const {
    difference.largest = largest_;
    difference.rms = std::sqrt(squares_ / static_cast<double>(count_));
    difference.rms_from = std::sqrt(squares_from_ / static_cast<double>(count_));
  }

 private:
  void add(const std::vector<double>& values, const std::vector<double>& others) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double apart = std::abs(others[i] - values[i]);
      largest_ = std::max(largest_, apart);
      squares_ += apart * apart;
      squares_from_ += values[i] * values[i];
    }
    count_ += values.size();
  }

  double largest_ = 0;
  double squares_ = 0;
  double squares_from_ = 0;
  std::uint64_t count_ = 0;
};

DatasetDifference compare(const char* path, const ClosedDatabase& from, const ClosedDatabase& to) {
  const auto a = from.info(path);
  const auto b = to.info(path);
  DatasetDifference difference;
  difference.path = path;
  if (a) {
    difference.shape_from = a->shape;
  }
  if (b) {
    difference.shape_to = b->shape;
  }
  if (!a || !b || a->shape != b->shape) {
    return difference;
  }
  const bool are_numbers = a->element != h5::Element::kText && b->element != h5::Element::kText;
  const std::uint64_t rows = a->shape.front();
  const std::uint64_t row_bytes = std::max(a->bytes, b->bytes) / rows;
  const std::uint64_t rows_at_once = std::clamp<std::uint64_t>(kPartBytes / row_bytes, 1, rows);
  difference.is_equal = a->element == b->element && a->bytes == b->bytes;
  Comparison numbers;
  for (std::uint64_t first = 0; first < rows; first += rows_at_once) {
    const std::uint64_t count = std::min(rows_at_once, rows - first);
    const std::vector<std::byte> values = from.rows(path, *a, first, count);
    const std::vector<std::byte> others = to.rows(path, *b, first, count);
    difference.is_equal = difference.is_equal && values == others;
    if (are_numbers) {
      numbers.add(a->element, values, a->element_bytes, b->element, others, b->element_bytes);
    }
  }
  if (are_numbers) {
    numbers.finish(difference);
  }
  return difference;
}

}  // namespace

std::vector<DatasetDifference> diff_databases(const std::filesystem::path& from,
                                              const std::filesystem::path& to) {
  const ClosedDatabase a(from);
  const ClosedDatabase b(to);
  std::vector<DatasetDifference> differences;
  for (const DatasetSpec& spec : dataset_specs()) {
    if (!spec.is_optional || a.info(spec.path) || b.info(spec.path)) {
      differences.push_back(compare(spec.path, a, b));
    }
  }
  return differences;
}

std::string description_json(const std::filesystem::path& path) {
  constexpr const char* kDescription = "/provenance/description";
  const ClosedDatabase file(path);
  const auto info = file.info(kDescription);
  const std::vector<std::byte> text =
      info ? file.rows(kDescription, *info, 0, 1) : std::vector<std::byte>();
  std::string json(text.size(), '\0');
  std::memcpy(json.data(), text.data(), json.size());
  return json.substr(0, json.find('\0'));
}

}  // namespace weft::storage
