#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "proto/weft/v1/task.pb.h"

namespace weft::v1 {

// IEEE half precision as raw bits, so that a span of halves is told apart from one of u16.
struct Half {
  std::uint16_t bits = 0;
};

// The envelope of results: named raw arrays, little-endian, row-major. Serialised field by field in
// the order they were added, so equal arrays give equal bytes.

// Appends an array. REQUIRES: the product of `shape` is data.size().
template <class T>
void add_array(Arrays& arrays, std::string name, std::vector<std::uint64_t> shape,
               std::span<const T> data);
void add_text(Arrays& arrays, std::string name, std::string_view text);

// The elements of array `name`. Throws core::Error(kDataLoss) when it is missing, has another type,
// or its bytes do not fill its shape. `shape`, when given, receives the shape.
template <class T>
[[nodiscard]] std::vector<T> array_of(const Arrays& arrays, std::string_view name,
                                      std::vector<std::uint64_t>* shape = nullptr);
[[nodiscard]] std::string text_of(const Arrays& arrays, std::string_view name);

[[nodiscard]] std::string serialize(const Arrays& arrays);
// Throws core::Error(kDataLoss) when the bytes are not an envelope.
[[nodiscard]] Arrays parse_arrays(std::string_view bytes);

// Bytes of a message by deterministic serialisation: what digests are taken of.
[[nodiscard]] std::string canonical_bytes(const google::protobuf::MessageLite& message);

}  // namespace weft::v1
