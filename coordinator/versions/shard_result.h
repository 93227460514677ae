#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "coordinator/versions/result_folding.h"
#include "core/error.h"
#include "proto/arrays.h"

namespace weft::coordinator {

// Throws core::Error(kDataLoss): the result called `name` is malformed.
[[noreturn]] inline void refuse_result(const std::string& name, const std::string& what) {
  throw core::Error(core::Code::kDataLoss, name + ": the result is malformed: " + what +
                                               "; delete it and compute it again");
}

// The envelope's own errors know neither stage nor shard: `name` says them.
template <class Function>
std::invoke_result_t<Function> naming(const std::string& name, Function function) {
  try {
    return function();
  } catch (const core::Error& error) {
    refuse_result(name, error.what());
  }
}

// The result of one shard, read array by array.
class ShardResult {
 public:
  ShardResult(const FinishedStage& finished, std::uint64_t shard, const ReadBlob& read_blob)
      : name_(std::string("stage ") + to_string(finished.stage.name) + ", shard " +
              std::to_string(shard)) {
    const std::string bytes = read_blob(finished.shards[shard]);
    arrays_ = naming(name_, [&] { return v1::parse_arrays(bytes); });
  }

  // Array `name`, which must have this shape.
  template <class T>
  [[nodiscard]] std::vector<T> array(const char* name,
                                     const std::vector<std::uint64_t>& expected) const {
    std::vector<std::uint64_t> shape;
    std::vector<T> data = naming(name_, [&] { return v1::array_of<T>(arrays_, name, &shape); });
    if (shape != expected) {
      refuse(std::string("array '") + name + "' has shape " + text_of(shape) + " where " +
             text_of(expected) + " was planned");
    }
    return data;
  }

  // The extents of array `name`.
  template <class T>
  [[nodiscard]] std::vector<std::uint64_t> shape_of(const char* name) const {
    std::vector<std::uint64_t> shape;
    naming(name_, [&] { return v1::array_of<T>(arrays_, name, &shape); });
    return shape;
  }

  [[noreturn]] void refuse(const std::string& what) const { refuse_result(name_, what); }

  void require(bool holds, const char* what) const {
    if (!holds) {
      refuse(what);
    }
  }

 private:
  static std::string text_of(const std::vector<std::uint64_t>& shape) {
    std::string text = "[";
    for (const std::uint64_t extent : shape) {
      text += (text.size() > 1 ? ", " : "") + std::to_string(extent);
    }
    return text + "]";
  }

  std::string name_;
  v1::Arrays arrays_;
};

[[nodiscard]] inline bool all_finite(const std::vector<float>& values) {
  return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
}

[[nodiscard]] inline bool all_finite(const std::vector<v1::Half>& values) {
  constexpr std::uint16_t kExponent = 0x7c00;
  return std::all_of(values.begin(), values.end(),
                     [](v1::Half v) { return (v.bits & kExponent) != kExponent; });
}

}  // namespace weft::coordinator
