#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "storage/h5.h"

// What writing and reading share: included by storage/h5*.cpp alone.

namespace weft::storage::h5 {

// Throws core::Error(kDataLoss): "dataset <path> <what>; ...".
[[noreturn]] void throw_damaged(const std::string& path, const std::string& what);

// A copy of the library's type. `text_bytes` is the fixed length of kText.
[[nodiscard]] Handle type_of(Element element, std::size_t text_bytes = 0);

// Element and element size of a dataset. Throws when it is none of ours.
[[nodiscard]] std::pair<Element, std::uint64_t> element_of(Id dataset, const std::string& path);

// The number of bytes of a shape, or nothing when it overflows.
[[nodiscard]] std::optional<std::uint64_t> bytes_of(const Shape& shape,
                                                    std::uint64_t element_bytes);

}  // namespace weft::storage::h5
