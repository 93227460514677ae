#include "storage/h5.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include <hdf5.h>
#include <hdf5_hl.h>

#include "core/check.h"
#include "core/error.h"
#include "storage/h5_filters.h"
#include "storage/h5_types.h"

namespace weft::storage::h5 {

namespace {

constexpr std::uint64_t kChunkBytes = std::uint64_t{1} << 20;
constexpr unsigned kDeflateLevel = 6;  // of texts; readers do not need it
constexpr unsigned kChunkIndexRank = 4;

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

std::vector<hsize_t> chunk_of(const Shape& shape, std::size_t element_bytes) {
  std::vector<hsize_t> chunk(shape.begin(), shape.end());
  const std::uint64_t row_bytes =
      std::max<std::uint64_t>(1, *bytes_of(shape, element_bytes) / shape[0]);
  chunk[0] = std::clamp<std::uint64_t>(kChunkBytes / row_bytes, 1, shape[0]);
  return chunk;
}

Handle dataset_properties(const std::vector<hsize_t>& chunk, bool compress) {
  Handle properties(H5Pcreate(H5P_DATASET_CREATE));
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

}  // namespace

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
  const std::vector<hsize_t> chunk = chunk_of(shape, element_bytes);
  const Handle properties = dataset_properties(chunk, compress);
  const Handle dataset = made(H5Dcreate2(file_.id(), path.c_str(), type.id(), space.id(),
                                         H5P_DEFAULT, properties.id(), H5P_DEFAULT),
                              path);
  // Filtered here and not by HDF5, which would do it in one thread.
  const std::uint64_t chunk_bytes = *bytes_of(Shape(chunk.begin(), chunk.end()), element_bytes);
  std::vector<hsize_t> at(shape.size(), 0);
  for (const FilteredChunk& filtered :
       filtered_chunks(data, chunk_bytes, element_bytes, compress)) {
    done(H5Dwrite_chunk(dataset.id(), H5P_DEFAULT, filtered.skipped, at.data(),
                        filtered.bytes.size(), filtered.bytes.data()),
         path);
    at[0] += chunk[0];
  }
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
  const Handle properties = dataset_properties(chunk_of({extent}, length), true);
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

}  // namespace weft::storage::h5
