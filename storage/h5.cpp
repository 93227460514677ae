#include "storage/h5.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <optional>
#include <system_error>
#include <utility>

#include <hdf5.h>
#include <hdf5_hl.h>

#include "core/check.h"
#include "core/error.h"

namespace weft::storage::h5 {

static_assert(sizeof(hid_t) == sizeof(Id));

namespace {

constexpr std::uint64_t kChunkBytes = std::uint64_t{1} << 20;
constexpr unsigned kDeflateLevel = 6;
constexpr unsigned kChunkIndexRank = 4;
constexpr std::uint64_t kMaxDeflateRatio = 1032;  // of the deflate format (zlib's own figure)
constexpr int kMaxRank = 8;
constexpr hsize_t kChunksLimit = 8192;

// The lock is recursive: one thread may read one file while it writes another.
std::recursive_mutex& library_mutex() {
  static std::recursive_mutex mutex;
  return mutex;
}

[[noreturn]] void throw_damaged(const std::string& path, const std::string& what) {
  throw core::Error(core::Code::kDataLoss,
                    "dataset " + path + " " + what + "; fetch the file again or make it anew");
}

Handle made(hid_t id, const std::string& path) {
  if (id < 0) {
    throw core::Error(core::Code::kResourceExhausted,
                      "cannot write dataset " + path + ": HDF5 has no memory left");
  }
  return Handle(id);
}

void done(herr_t status, const std::string& path) {
  if (status < 0) {
    throw core::Error(core::Code::kResourceExhausted,
                      "cannot write dataset " + path + ": HDF5 has no memory left");
  }
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

// A copy of the library's type. `text_bytes` is the fixed length of kText.
Handle type_of(Element element, std::size_t text_bytes = 0) {
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

constexpr Element kNumbers[] = {Element::kU16, Element::kU32, Element::kU64, Element::kI32,
                                Element::kF16, Element::kF32, Element::kF64};

// The number of bytes of a shape, or nothing when it overflows.
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

Handle dataset_properties(const Shape& shape, std::size_t element_bytes, bool compress) {
  Handle properties(H5Pcreate(H5P_DATASET_CREATE));
  std::vector<hsize_t> chunk(shape.begin(), shape.end());
  const std::uint64_t row_bytes =
      std::max<std::uint64_t>(1, *bytes_of(shape, element_bytes) / shape[0]);
  chunk[0] = std::clamp<std::uint64_t>(kChunkBytes / row_bytes, 1, shape[0]);
  CHECK(H5Pset_chunk(properties.id(), static_cast<int>(chunk.size()), chunk.data()) >= 0);
  CHECK(H5Pset_obj_track_times(properties.id(), false) >= 0);
  CHECK(H5Pset_fill_time(properties.id(), H5D_FILL_TIME_NEVER) >= 0);
  if (compress) {
    CHECK(H5Pset_shuffle(properties.id()) >= 0);
    CHECK(H5Pset_deflate(properties.id(), kDeflateLevel) >= 0);
  }
  CHECK(H5Pset_fletcher32(properties.id()) >= 0);
  return properties;
}

void add_text_attribute(hid_t object, const std::string& path, const std::string& name,
                        const std::string& value) {
  const Handle type = type_of(Element::kText, std::max<std::size_t>(1, value.size()));
  const Handle space(H5Screate(H5S_SCALAR));
  const Handle attribute =
      made(H5Acreate2(object, name.c_str(), type.id(), space.id(), H5P_DEFAULT, H5P_DEFAULT), path);
  done(H5Awrite(attribute.id(), type.id(), value.c_str()), path);
}

void add_caption(hid_t dataset, const std::string& path, const Caption& caption) {
  add_text_attribute(dataset, path, "units", caption.units);
  add_text_attribute(dataset, path, "axes", caption.axes);
  add_text_attribute(dataset, path, "description", caption.description);
}

// Whether every filter is one of ours, and the data lies chunk by chunk in this very file.
void check_storage(hid_t dataset, const std::string& path, const Shape& shape) {
  const Handle properties(H5Dget_create_plist(dataset));
  if (properties.id() < 0 || H5Pget_layout(properties.id()) != H5D_CHUNKED ||
      H5Pget_external_count(properties.id()) != 0) {
    throw_damaged(path, "is not stored in chunks inside the file");
  }
  std::vector<hsize_t> chunk(shape.size());
  const int rank = static_cast<int>(chunk.size());
  if (H5Pget_chunk(properties.id(), rank, chunk.data()) != rank) {
    throw_damaged(path, "has damaged chunks");
  }
  for (std::size_t axis = 0; axis < chunk.size(); ++axis) {
    if (chunk[axis] == 0 || chunk[axis] > shape[axis]) {
      throw_damaged(path, "has chunks that are larger than itself");
    }
  }
  const int filters = H5Pget_nfilters(properties.id());
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0;
    std::size_t values = 0;
    const H5Z_filter_t filter = H5Pget_filter2(properties.id(), static_cast<unsigned>(i), &flags,
                                               &values, nullptr, 0, nullptr, nullptr);
    if (filter != H5Z_FILTER_SHUFFLE && filter != H5Z_FILTER_DEFLATE &&
        filter != H5Z_FILTER_FLETCHER32) {
      throw_damaged(path, "uses a filter that fabric databases do not have");
    }
  }
  if (filters < 0 || filters > 3) {
    throw_damaged(path, "has damaged filters");
  }
}

// Element and element size of a dataset.
std::pair<Element, std::uint64_t> element_of(hid_t dataset, const std::string& path) {
  const Handle type(H5Dget_type(dataset));
  if (type.id() >= 0) {
    for (const Element element : kNumbers) {
      const Handle candidate = type_of(element);
      if (H5Tequal(type.id(), candidate.id()) > 0) {
        return {element, H5Tget_size(type.id())};
      }
    }
    if (H5Tget_class(type.id()) == H5T_STRING && H5Tis_variable_str(type.id()) == 0 &&
        H5Tget_size(type.id()) > 0) {
      return {Element::kText, H5Tget_size(type.id())};
    }
  }
  throw_damaged(path, "has elements of a kind that fabric databases do not have");
}

}  // namespace

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

Session::Session() : lock_(library_mutex()) { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

ImageWriter::ImageWriter(std::uint64_t user_block_bytes) : user_block_bytes_(user_block_bytes) {
  const Handle access(H5Pcreate(H5P_FILE_ACCESS));
  CHECK(H5Pset_fapl_core(access.id(), std::size_t{16} << 20, false) >= 0);
  // The oldest format: every tool reads it. (With the superblock of 1.8 the image of an open file
  // has a wrong checksum.)
  CHECK(H5Pset_libver_bounds(access.id(), H5F_LIBVER_EARLIEST, H5F_LIBVER_V18) >= 0);
  const Handle creation(H5Pcreate(H5P_FILE_CREATE));
  CHECK(H5Pset_userblock(creation.id(), user_block_bytes) >= 0);
  // Most datasets have one chunk: small index nodes take an eighth of the usual ones' room.
  CHECK(H5Pset_istore_k(creation.id(), kChunkIndexRank) >= 0);
  CHECK(H5Pset_obj_track_times(creation.id(), false) >= 0);
  CHECK(H5Pset_link_creation_order(creation.id(), H5P_CRT_ORDER_TRACKED) >= 0);
  file_ = made(H5Fcreate("weft", H5F_ACC_TRUNC, creation.id(), access.id()), "/");
}

void ImageWriter::add_group(const std::string& path, const std::string& description) {
  const Handle creation(H5Pcreate(H5P_GROUP_CREATE));
  CHECK(H5Pset_obj_track_times(creation.id(), false) >= 0);
  CHECK(H5Pset_link_creation_order(creation.id(), H5P_CRT_ORDER_TRACKED) >= 0);
  const Handle group =
      made(H5Gcreate2(file_.id(), path.c_str(), H5P_DEFAULT, creation.id(), H5P_DEFAULT), path);
  add_text_attribute(group.id(), path, "description", description);
}

void ImageWriter::add_array(const std::string& path, Element element, const Shape& shape,
                            std::span<const std::byte> data, bool compress,
                            const Caption& caption) {
  const Handle type = type_of(element);
  const std::size_t element_bytes = H5Tget_size(type.id());
  CHECK_EQ(bytes_of(shape, element_bytes).value_or(0), data.size());
  CHECK(!data.empty());
  const std::vector<hsize_t> extents(shape.begin(), shape.end());
  const Handle space(H5Screate_simple(static_cast<int>(extents.size()), extents.data(), nullptr));
  const Handle properties = dataset_properties(shape, element_bytes, compress);
  const Handle dataset = made(H5Dcreate2(file_.id(), path.c_str(), type.id(), space.id(),
                                         H5P_DEFAULT, properties.id(), H5P_DEFAULT),
                              path);
  done(H5Dwrite(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data()), path);
  add_caption(dataset.id(), path, caption);
}

void ImageWriter::add_text(const std::string& path, const std::vector<std::string>& texts,
                           const Caption& caption) {
  std::size_t length = 1;
  for (const std::string& text : texts) {
    length = std::max(length, text.size());
  }
  std::vector<char> data(length * texts.size(), '\0');
  CHECK(!data.empty());
  for (std::size_t i = 0; i < texts.size(); ++i) {
    std::copy(texts[i].begin(), texts[i].end(),
              data.begin() + static_cast<std::ptrdiff_t>(i * length));
  }
  const Handle type = type_of(Element::kText, length);
  const hsize_t extent = texts.size();
  const Handle space(H5Screate_simple(1, &extent, nullptr));
  const Handle properties = dataset_properties({extent}, length, true);
  const Handle dataset = made(H5Dcreate2(file_.id(), path.c_str(), type.id(), space.id(),
                                         H5P_DEFAULT, properties.id(), H5P_DEFAULT),
                              path);
  done(H5Dwrite(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data()), path);
  add_caption(dataset.id(), path, caption);
}

Handle ImageWriter::open(const std::string& path) const {
  return made(H5Oopen(file_.id(), path.c_str(), H5P_DEFAULT), path);
}

void ImageWriter::add_attribute(const std::string& path, const std::string& name,
                                const std::string& value) {
  add_text_attribute(open(path).id(), path, name, value);
}

void ImageWriter::add_attribute(const std::string& path, const std::string& name, double value) {
  const Handle object = open(path);
  const Handle type = type_of(Element::kF64);
  const Handle space(H5Screate(H5S_SCALAR));
  const Handle attribute = made(
      H5Acreate2(object.id(), name.c_str(), type.id(), space.id(), H5P_DEFAULT, H5P_DEFAULT), path);
  done(H5Awrite(attribute.id(), type.id(), &value), path);
}

void ImageWriter::attach_scale(const std::string& path, unsigned axis, const std::string& scale) {
  const Handle dataset = open(path);
  const Handle scale_dataset = open(scale);
  if (H5DSis_scale(scale_dataset.id()) <= 0) {
    done(H5DSset_scale(scale_dataset.id(), scale.substr(scale.rfind('/') + 1).c_str()), scale);
  }
  done(H5DSattach_scale(dataset.id(), scale_dataset.id(), axis), path);
}

std::string ImageWriter::finish() {
  done(H5Fflush(file_.id(), H5F_SCOPE_LOCAL), "/");
  const ssize_t size = H5Fget_file_image(file_.id(), nullptr, 0);
  CHECK_GT(size, 0);
  // The library's image leaves the user block out.
  std::string image(user_block_bytes_ + static_cast<std::size_t>(size), '\0');
  CHECK_EQ(H5Fget_file_image(file_.id(), image.data() + user_block_bytes_,
                             static_cast<std::size_t>(size)),
           size);
  file_ = Handle();
  return image;
}

Reader::Reader(const std::filesystem::path& path) {
  std::error_code failure;
  file_bytes_ = std::filesystem::file_size(path, failure);
  if (failure) {
    throw core::Error(core::Code::kNotFound,
                      "cannot read " + path.string() + ": " + failure.message());
  }
  const Handle access(H5Pcreate(H5P_FILE_ACCESS));
  CHECK(H5Pset_file_locking(access.id(), false, true) >= 0);
  file_ = Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.id()));
  if (file_.id() < 0) {
    throw core::Error(core::Code::kDataLoss, path.string() + " is damaged: HDF5 cannot open it");
  }
}

// Every step of the path is a hard link: nothing leads out of the file.
Handle Reader::open(const std::string& path) const {
  for (std::size_t end = path.find('/', 1);; end = path.find('/', end + 1)) {
    const std::string prefix = path.substr(0, end);
    H5L_info_t link{};
    if (H5Lget_info(file_.id(), prefix.c_str(), &link, H5P_DEFAULT) < 0) {
      throw_damaged(path, "is missing");
    }
    if (link.type != H5L_TYPE_HARD) {
      throw_damaged(path, "is a link that leads elsewhere");
    }
    if (end == std::string::npos) {
      break;
    }
  }
  Handle object(H5Oopen(file_.id(), path.c_str(), H5P_DEFAULT));
  if (object.id() < 0 || H5Iget_type(object.id()) != H5I_DATASET) {
    throw_damaged(path, "cannot be opened");
  }
  return object;
}

Reader::Info Reader::info(const std::string& path) const {
  const Handle dataset = open(path);
  const Handle space(H5Dget_space(dataset.id()));
  const int rank = H5Sget_simple_extent_ndims(space.id());
  if (rank < 1 || rank > kMaxRank) {
    throw_damaged(path, "has no usable shape");
  }
  std::vector<hsize_t> extents(static_cast<std::size_t>(rank));
  if (H5Sget_simple_extent_dims(space.id(), extents.data(), nullptr) != rank) {
    throw_damaged(path, "has no usable shape");
  }
  Info info;
  info.shape.assign(extents.begin(), extents.end());
  std::tie(info.element, info.element_bytes) = element_of(dataset.id(), path);
  check_storage(dataset.id(), path, info.shape);
  info.stored_bytes = H5Dget_storage_size(dataset.id());
  const std::optional<std::uint64_t> bytes = bytes_of(info.shape, info.element_bytes);
  if (!bytes || info.stored_bytes > file_bytes_ || *bytes / kMaxDeflateRatio > info.stored_bytes) {
    throw_damaged(path, "claims the shape " + to_string(info.shape) +
                            ", which the file is too small to hold");
  }
  return info;
}

void Reader::admit(const std::string& path, const Info& info) {
  const std::optional<std::uint64_t> bytes = bytes_of(info.shape, info.element_bytes);
  if (!bytes || *bytes > kReadLimitBytes - decoded_bytes_) {
    throw core::Error(core::Code::kResourceExhausted, "the database needs more than the limit of " +
                                                          std::to_string(kReadLimitBytes) +
                                                          " bytes of memory");
  }
  decoded_bytes_ += *bytes;
  claimed_bytes_ += info.stored_bytes;
  if (claimed_bytes_ > file_bytes_) {
    throw_damaged(path, "and those before it claim more bytes than the file has");
  }
}

void Reader::read(const std::string& path, const Info& info, std::span<std::byte> out) const {
  CHECK_EQ(bytes_of(info.shape, info.element_bytes).value_or(0), out.size());
  const Handle dataset = open(path);
  const Handle type = type_of(info.element, info.element_bytes);
  if (H5Dread(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, out.data()) < 0) {
    throw_damaged(path, "is damaged: its checksum or its compression does not hold");
  }
}

std::vector<Reader::Extent> Reader::chunks(const std::string& path) const {
  const Handle dataset = open(path);
  const Handle space(H5Dget_space(dataset.id()));
  hsize_t count = 0;
  // The library walks its index anew for each chunk.
  if (H5Dget_num_chunks(dataset.id(), space.id(), &count) < 0 || count > kChunksLimit) {
    throw_damaged(path, "has more chunks than databases have");
  }
  std::vector<Extent> extents;
  for (hsize_t i = 0; i < count; ++i) {
    std::array<hsize_t, kMaxRank + 1> first{};
    unsigned filters = 0;
    haddr_t offset = 0;
    hsize_t bytes = 0;
    if (H5Dget_chunk_info(dataset.id(), space.id(), i, first.data(), &filters, &offset, &bytes) <
        0) {
      throw_damaged(path, "has damaged chunks");
    }
    extents.push_back({offset, bytes});
  }
  return extents;
}

std::vector<std::string> Reader::read_text(const std::string& path) {
  const Info found = info(path);
  if (found.element != Element::kText || found.shape.size() != 1) {
    throw_damaged(path, "is not a list of texts");
  }
  admit(path, found);
  std::vector<char> data(found.shape[0] * found.element_bytes);
  read(path, found, std::as_writable_bytes(std::span(data)));
  std::vector<std::string> texts;
  for (std::uint64_t i = 0; i < found.shape[0]; ++i) {
    const char* text = data.data() + i * found.element_bytes;
    texts.emplace_back(text, strnlen(text, found.element_bytes));
  }
  return texts;
}

}  // namespace weft::storage::h5
