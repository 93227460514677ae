#include "proto/arrays.h"

#include <cstring>
#include <limits>

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include "core/check.h"
#include "core/error.h"

namespace weft::v1 {

namespace {

template <class T>
constexpr DataType kTypeOf = DATA_TYPE_UNSPECIFIED;
template <>
constexpr DataType kTypeOf<std::uint8_t> = DATA_TYPE_U8;
template <>
constexpr DataType kTypeOf<std::uint32_t> = DATA_TYPE_U32;
template <>
constexpr DataType kTypeOf<std::uint64_t> = DATA_TYPE_U64;
template <>
constexpr DataType kTypeOf<std::int32_t> = DATA_TYPE_I32;
template <>
constexpr DataType kTypeOf<std::int64_t> = DATA_TYPE_I64;
template <>
constexpr DataType kTypeOf<Half> = DATA_TYPE_F16;
template <>
constexpr DataType kTypeOf<float> = DATA_TYPE_F32;
template <>
constexpr DataType kTypeOf<double> = DATA_TYPE_F64;

// The number of elements, or nothing when it overflows.
std::optional<std::uint64_t> element_count(const Array& array) {
  std::uint64_t count = 1;
  for (const std::uint64_t extent : array.shape()) {
    if (extent != 0 && count > std::numeric_limits<std::uint64_t>::max() / extent) {
      return std::nullopt;
    }
    count *= extent;
  }
  return count;
}

const Array& find(const Arrays& arrays, std::string_view name, DataType type) {
  for (const Array& array : arrays.arrays()) {
    if (array.name() == name) {
      if (array.type() != type) {
        throw core::Error(core::Code::kDataLoss, "array '" + std::string(name) + "' has type " +
                                                     DataType_Name(array.type()) + " where " +
                                                     DataType_Name(type) + " was expected");
      }
      return array;
    }
  }
  throw core::Error(core::Code::kDataLoss, "array '" + std::string(name) + "' is missing");
}

}  // namespace

template <class T>
void add_array(Arrays& arrays, std::string name, std::vector<std::uint64_t> shape,
               std::span<const T> data) {
  Array& array = *arrays.add_arrays();
  array.set_name(std::move(name));
  array.set_type(kTypeOf<T>);
  array.mutable_shape()->Add(shape.begin(), shape.end());
  array.set_data(data.data(), data.size_bytes());
  CHECK_EQ(element_count(array).value_or(0), data.size());
}

void add_text(Arrays& arrays, std::string name, std::string_view text) {
  Array& array = *arrays.add_arrays();
  array.set_name(std::move(name));
  array.set_type(DATA_TYPE_TEXT);
  array.add_shape(text.size());
  array.set_data(text.data(), text.size());
}

template <class T>
std::vector<T> array_of(const Arrays& arrays, std::string_view name,
                        std::vector<std::uint64_t>* shape) {
  const Array& array = find(arrays, name, kTypeOf<T>);
  const std::optional<std::uint64_t> count = element_count(array);
  if (!count || *count > array.data().size() || *count * sizeof(T) != array.data().size()) {
    throw core::Error(core::Code::kDataLoss,
                      "array '" + std::string(name) + "' does not fill its shape");
  }
  if (shape != nullptr) {
    shape->assign(array.shape().begin(), array.shape().end());
  }
  std::vector<T> data(*count);
  if (!data.empty()) {
    std::memcpy(data.data(), array.data().data(), array.data().size());
  }
  return data;
}

std::string text_of(const Arrays& arrays, std::string_view name) {
  return find(arrays, name, DATA_TYPE_TEXT).data();
}

#define WEFT_INSTANTIATE(T)                                                    \
  template void add_array<T>(Arrays&, std::string, std::vector<std::uint64_t>, \
                             std::span<const T>);                              \
  template std::vector<T> array_of<T>(const Arrays&, std::string_view, std::vector<std::uint64_t>*);
WEFT_INSTANTIATE(std::uint8_t)
WEFT_INSTANTIATE(std::uint32_t)
WEFT_INSTANTIATE(std::uint64_t)
WEFT_INSTANTIATE(std::int32_t)
WEFT_INSTANTIATE(std::int64_t)
WEFT_INSTANTIATE(Half)
WEFT_INSTANTIATE(float)
WEFT_INSTANTIATE(double)
#undef WEFT_INSTANTIATE

std::string serialize(const Arrays& arrays) { return canonical_bytes(arrays); }

Arrays parse_arrays(std::string_view bytes) {
  Arrays arrays;
  google::protobuf::io::ArrayInputStream stream(bytes.data(), static_cast<int>(bytes.size()));
  google::protobuf::io::CodedInputStream coded(&stream);
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()) ||
      !arrays.ParseFromCodedStream(&coded) || !coded.ConsumedEntireMessage()) {
    throw core::Error(core::Code::kDataLoss, "the bytes are not an envelope of arrays");
  }
  return arrays;
}

std::string canonical_bytes(const google::protobuf::MessageLite& message) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    CHECK(message.SerializeToCodedStream(&coded));
  }
  return bytes;
}

}  // namespace weft::v1
