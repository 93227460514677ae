#include "storage/h5_types.h"

#include <limits>
#include <utility>

#include <hdf5.h>

#include "core/check.h"
#include "core/error.h"

namespace weft::storage::h5 {

static_assert(sizeof(hid_t) == sizeof(Id));

namespace {

// The lock is recursive: one thread may read one file while it writes another.
std::recursive_mutex& library_mutex() {
  static std::recursive_mutex mutex;
  return mutex;
}

// IEEE binary16, as h5py and numpy write it.
Handle half_type() {
  Handle half(H5Tcopy(H5T_IEEE_F32LE));
  CHECK(H5Tset_fields(half.id(), 15, 10, 5, 0, 10) >= 0);
  CHECK(H5Tset_size(half.id(), 2) >= 0);
  CHECK(H5Tset_ebias(half.id(), 15) >= 0);
  return half;
}

Handle text_type(std::size_t bytes) {
  Handle text(H5Tcopy(H5T_C_S1));
  CHECK(H5Tset_size(text.id(), bytes) >= 0);
  CHECK(H5Tset_strpad(text.id(), H5T_STR_NULLPAD) >= 0);
  CHECK(H5Tset_cset(text.id(), H5T_CSET_UTF8) >= 0);
  return text;
}

constexpr Element kNumbers[] = {Element::kU16, Element::kU32, Element::kU64, Element::kI32,
                                Element::kF16, Element::kF32, Element::kF64};

}  // namespace

void throw_damaged(const std::string& path, const std::string& what) {
  throw core::Error(core::Code::kDataLoss,
                    "dataset " + path + " " + what + "; fetch the file again or make it anew");
}

Handle type_of(Element element, std::size_t text_bytes) {
  switch (element) {
    case Element::kU16:
      return Handle(H5Tcopy(H5T_STD_U16LE));
    case Element::kU32:
      return Handle(H5Tcopy(H5T_STD_U32LE));
    case Element::kU64:
      return Handle(H5Tcopy(H5T_STD_U64LE));
    case Element::kI32:
      return Handle(H5Tcopy(H5T_STD_I32LE));
    case Element::kF16:
      return half_type();
    case Element::kF32:
      return Handle(H5Tcopy(H5T_IEEE_F32LE));
    case Element::kF64:
      return Handle(H5Tcopy(H5T_IEEE_F64LE));
    case Element::kText:
      return text_type(text_bytes);
  }
  core::check_failed(__FILE__, __LINE__, "unknown element");
}

std::optional<std::uint64_t> bytes_of(const Shape& shape, std::uint64_t element_bytes) {
  std::uint64_t bytes = element_bytes;
  for (const std::uint64_t extent : shape) {
    if (extent != 0 && bytes > std::numeric_limits<std::uint64_t>::max() / extent) {
      return std::nullopt;
    }
    bytes *= extent;
  }
  return bytes;
}

std::pair<Element, std::uint64_t> element_of(Id dataset, const std::string& path) {
  const Handle type(H5Dget_type(dataset));
  if (type.id() >= 0) {
    for (const Element element : kNumbers) {
      const Handle candidate = type_of(element);
      if (H5Tequal(type.id(), candidate.id()) > 0) {
        return {element, H5Tget_size(type.id())};
      }
    }
    if (H5Tget_class(type.id()) == H5T_STRING && H5Tis_variable_str(type.id()) == 0) {
      const std::size_t length = H5Tget_size(type.id());
      if (length > 0 && H5Tequal(type.id(), type_of(Element::kText, length).id()) > 0) {
        return {Element::kText, length};
      }
    }
  }
  throw_damaged(path, "has elements of a kind that fabric databases do not have");
}

const char* to_string(Element element) {
  switch (element) {
    case Element::kU16:
      return "u16";
    case Element::kU32:
      return "u32";
    case Element::kU64:
      return "u64";
    case Element::kI32:
      return "i32";
    case Element::kF16:
      return "f16";
    case Element::kF32:
      return "f32";
    case Element::kF64:
      return "f64";
    case Element::kText:
      return "text";
  }
  core::check_failed(__FILE__, __LINE__, "unknown element");
}

std::string to_string(const Shape& shape) {
  std::string text = "[";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    text += (i == 0 ? "" : ", ") + std::to_string(shape[i]);
  }
  return text + "]";
}

Handle::~Handle() {
  if (id_ >= 0) {
    H5Idec_ref(id_);
  }
}

Handle::Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)) {}

Handle& Handle::operator=(Handle&& other) noexcept {
  std::swap(id_, other.id_);
  return *this;
}

Session::Session() : lock_(library_mutex()) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  // A file may name a filter that would be loaded from a folder of plug-ins.
  CHECK(H5PLset_loading_state(0) >= 0);
}

}  // namespace weft::storage::h5
