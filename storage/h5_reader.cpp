#include "storage/h5_reader.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include <hdf5.h>

#include "core/check.h"
#include "core/error.h"
#include "core/mistakes.h"
#include "storage/h5_chunk_reader.h"
#include "storage/h5_chunks.h"
#include "storage/h5_types.h"

namespace weft::storage::h5 {

namespace {

constexpr std::uint64_t kReadLimitBytes = std::uint64_t{8} << 30;
constexpr std::uint64_t kReadAllowanceBytes = std::uint64_t{64} << 20;
constexpr std::uint64_t kReadRatio = 32;
constexpr std::uint64_t kMaxDeflateRatio = 1032;  // of the deflate format (zlib's own figure)
constexpr int kMaxRank = 8;
constexpr std::size_t kLinksLimit = 64;  // of a group
constexpr std::array<unsigned char, 8> kSignature = {0x89, 'H', 'D', 'F', '\r', '\n', 0x1a, '\n'};

// The library's way to leave a file in the memory where it is: these hand out that memory and give
// nothing back.
void* take_image(std::size_t, H5FD_file_image_op_t, void* image) { return image; }
void* copy_image(void* to, const void*, std::size_t, H5FD_file_image_op_t, void*) { return to; }
void* grow_image(void*, std::size_t, H5FD_file_image_op_t, void*) { return nullptr; }
herr_t keep_image(void*, H5FD_file_image_op_t, void*) { return 0; }
void* same_image(void* image) { return image; }
herr_t keep(void*) { return 0; }

Handle open_image(std::span<const std::byte> file) {
  // Only read, whatever the type says.
  void* image = const_cast<std::byte*>(file.data());
  H5FD_file_image_callbacks_t callbacks{take_image, copy_image, grow_image, keep_image,
                                        same_image, keep,       image};
  const Handle access(H5Pcreate(H5P_FILE_ACCESS));
  CHECK(H5Pset_fapl_core(access.id(), file.size(), false) >= 0);
  CHECK(H5Pset_file_image_callbacks(access.id(), &callbacks) >= 0);
  CHECK(H5Pset_file_image(access.id(), image, file.size()) >= 0);
  // The library insists that there is no file of the image's name.
  return Handle(H5Fopen("/dev/null/weft", H5F_ACC_RDONLY, access.id()));
}

struct Link {
  std::string name;
  bool is_hard = false;
};

// Called by the library for each link of a group; fails after kLinksLimit.
herr_t take_link(hid_t, const char* name, const H5L_info_t* info, void* links) {
  auto& list = *static_cast<std::vector<Link>*>(links);
  list.push_back({name, info->type == H5L_TYPE_HARD});
  return list.size() > kLinksLimit ? 1 : 0;
}

}  // namespace

std::uint64_t decoded_limit_bytes(std::uint64_t file_bytes) {
  return file_bytes > kReadLimitBytes / kReadRatio
             ? kReadLimitBytes
             : std::min(kReadLimitBytes, kReadAllowanceBytes + kReadRatio * file_bytes);
}

Reader::Reader(std::span<const std::byte> file, std::uint64_t user_block_bytes, Decoding decoding)
    : file_bytes_(file.size()), decoding_(decoding) {
  const auto refuse = [] {
    throw core::Error(core::Code::kDataLoss,
                      "the file is damaged: HDF5 cannot open it; fetch or make it again");
  };
  // The library would look for its beginning further on.
  if (file_bytes_ < user_block_bytes + kSignature.size() ||
      std::memcmp(file.data() + user_block_bytes, kSignature.data(), kSignature.size()) != 0) {
    refuse();
  }
  file_ = open_image(file);
  if (file_.id() < 0) {
    refuse();
  }
  const Handle creation(H5Fget_create_plist(file_.id()));
  hsize_t found_bytes = 0;
  if (H5Pget_userblock(creation.id(), &found_bytes) < 0 || found_bytes != user_block_bytes) {
    refuse();
  }
}

void Reader::require_only(const std::set<std::string>& groups,
                          const std::set<std::string>& datasets) {
  require_only_in("/", groups, datasets);
  for (const std::string& group : groups) {
    require_only_in(group, groups, datasets);
  }
}

void Reader::require_only_in(const std::string& group, const std::set<std::string>& groups,
                             const std::set<std::string>& datasets) const {
  const Handle opened(H5Gopen2(file_.id(), group.c_str(), H5P_DEFAULT));
  H5G_info_t info{};
  if (opened.id() >= 0 && H5Gget_info(opened.id(), &info) >= 0 && info.nlinks > kLinksLimit) {
    throw_damaged(group, "is a group of more than " + std::to_string(kLinksLimit) + " entries");
  }
  std::vector<Link> links;
  if (opened.id() < 0 ||
      H5Literate(opened.id(), H5_INDEX_NAME, H5_ITER_INC, nullptr, take_link, &links) != 0) {
    throw_damaged(group, "is missing or no group");
  }
  for (const Link& link : links) {
    const std::string path = (group == "/" ? "" : group) + "/" + link.name;
    const bool is_known = groups.count(path) + datasets.count(path) > 0;
    if (!link.is_hard) {
      throw_damaged(is_known ? path : core::in_quotes(path), "is a link that leads elsewhere");
    }
    if (!is_known) {
      throw_damaged(core::in_quotes(path), "is nothing that fabric databases have");
    }
  }
  check_header(group);
}

// Attributes are for people and never read; still they may not grow beyond all measure.
void Reader::check_header(const std::string& path) const {
  H5O_info_t info{};
  if (H5Oget_info_by_name2(file_.id(), path.c_str(), &info, H5O_INFO_ALL, H5P_DEFAULT) < 0) {
    throw_damaged(path, "has a damaged header");
  }
  if (info.num_attrs > kAttributesLimit || info.hdr.space.total > kHeaderLimitBytes ||
      info.meta_size.attr.heap_size > kHeaderLimitBytes ||
      info.meta_size.attr.index_size > kHeaderLimitBytes) {
    throw_damaged(path, "has more or larger attributes than fabric databases have");
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

bool Reader::has(const std::string& path) {
  for (std::size_t end = path.find('/', 1);; end = path.find('/', end + 1)) {
    if (H5Lexists(file_.id(), path.substr(0, end).c_str(), H5P_DEFAULT) <= 0) {
      return false;
    }
    if (end == std::string::npos) {
      return true;
    }
  }
}

Reader::Info Reader::info(const std::string& path) {
  const Handle dataset = open(path);
  check_header(path);
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
  if (std::find(info.shape.begin(), info.shape.end(), 0) != info.shape.end()) {
    throw_damaged(path, "is empty");
  }
  std::tie(info.element, info.element_bytes) = element_of(dataset.id(), path);
  info.stored_bytes = H5Dget_storage_size(dataset.id());
  const std::optional<std::uint64_t> bytes = bytes_of(info.shape, info.element_bytes);
  if (!bytes || info.stored_bytes > file_bytes_ || *bytes / kMaxDeflateRatio > info.stored_bytes) {
    throw_damaged(path, "claims the shape " + to_string(info.shape) +
                            ", which the file is too small to hold");
  }
  info.bytes = *bytes;
  check_storage(dataset.id(), path, info, file_bytes_);
  return info;
}

std::vector<Reader::Extent> Reader::chunks(const std::string& path) {
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

void Reader::admit(const std::string& path, const Info& info) {
  const std::uint64_t limit_bytes = decoded_limit_bytes(file_bytes_);
  if (info.bytes > limit_bytes - decoded_bytes_) {
    throw core::Error(core::Code::kResourceExhausted,
                      "dataset " + path + " and those before it unfold to more than the limit of " +
                          std::to_string(limit_bytes >> 20) + " MiB for a file of this size");
  }
  decoded_bytes_ += info.bytes;
  claimed_bytes_ += info.stored_bytes;
  if (claimed_bytes_ > file_bytes_) {
    throw_damaged(path, "and those before it claim more bytes than the file has");
  }
}

void Reader::read(const std::string& path, const Info& info, std::span<std::byte> out) {
  read_rows(path, info, 0, info.shape.front(), out);
}

void Reader::read_rows(const std::string& path, const Info& info, std::uint64_t first,
                       std::uint64_t count, std::span<std::byte> out) {
  CHECK(first + count <= info.shape.front());
  CHECK_EQ(info.bytes / info.shape.front() * count, out.size());
  read_chunks(open(path).id(), path, info, {first, count}, decoding_, out);
}

}  // namespace weft::storage::h5
