#include "storage/flat_database.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "core/check.h"
#include "core/error.h"
#include "storage/database_schema.h"
#include "storage/user_block.h"

namespace weft::storage {

namespace {

constexpr std::uint64_t kRankLimit = 8;

[[noreturn]] void throw_not_whole(const std::string& path) {
  throw core::Error(core::Code::kDataLoss, "dataset " + path +
                                               " did not come back as it should from the program "
                                               "that read it; fetch or make the file again");
}

// What elements of this kind have; 0 for text, whose length is its own.
std::uint64_t fixed_bytes(h5::Element element) {
  switch (element) {
    case h5::Element::kU16:
    case h5::Element::kF16:
      return 2;
    case h5::Element::kU32:
    case h5::Element::kI32:
    case h5::Element::kF32:
      return 4;
    case h5::Element::kU64:
    case h5::Element::kF64:
      return 8;
    case h5::Element::kText:
      return 0;
  }
  core::check_failed(__FILE__, __LINE__, "unknown element");
}

DatasetSource::Info read_info(core::FlatReader& in, const std::string& path) {
  DatasetSource::Info info;
  const std::uint64_t element = in.number();
  info.element_bytes = in.number();
  info.stored_bytes = in.number();
  const std::uint64_t rank = in.number();
  if (element > static_cast<std::uint64_t>(h5::Element::kText) || info.element_bytes == 0 ||
      rank == 0 || rank > kRankLimit) {
    throw_not_whole(path);
  }
  info.element = static_cast<h5::Element>(element);
  const std::uint64_t fixed = fixed_bytes(info.element);
  if (fixed != 0 && fixed != info.element_bytes) {
    throw_not_whole(path);
  }
  info.bytes = info.element_bytes;
  for (std::uint64_t axis = 0; axis < rank; ++axis) {
    const std::uint64_t extent = in.number();
    if (extent == 0 || info.bytes > std::numeric_limits<std::uint64_t>::max() / extent) {
      throw_not_whole(path);
    }
    info.shape.push_back(extent);
    info.bytes *= extent;
  }
  return info;
}

std::vector<DatasetSource::Extent> read_chunks(core::FlatReader& in, const std::string& path) {
  const std::uint64_t count = in.number();
  if (count > DatasetSource::kChunksLimit) {
    throw_not_whole(path);
  }
  std::vector<DatasetSource::Extent> chunks;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t offset = in.number();
    chunks.push_back({offset, in.number()});
  }
  return chunks;
}

}  // namespace

void flatten_database(DatasetSource& source, Flattened what, core::FlatWriter& out) {
  Extents extents;
  std::vector<std::byte> data;
  for (const DatasetSpec& spec : dataset_specs()) {
    if (spec.is_optional) {
      const bool is_there = source.has(spec.path);
      out.number(is_there ? 1 : 0);
      if (!is_there) {
        continue;
      }
    }
    const DatasetSource::Info info = source.info(spec.path);
    extents.bind(spec, info.shape);
    source.admit(spec.path, info);
    out.number(static_cast<std::uint64_t>(info.element));
    out.number(info.element_bytes);
    out.number(info.stored_bytes);
    out.number(info.shape.size());
    for (const std::uint64_t extent : info.shape) {
      out.number(extent);
    }
    if (what == Flattened::kArrays) {
      data.resize(info.bytes);
      source.read(spec.path, info, data);
      out.bytes(data);
      continue;
    }
    const std::vector<DatasetSource::Extent> chunks = source.chunks(spec.path);
    out.number(chunks.size());
    for (const DatasetSource::Extent& chunk : chunks) {
      out.number(chunk.offset);
      out.number(chunk.size_bytes);
    }
  }
}

FlatDatabase::FlatDatabase(std::span<const std::byte> data, Flattened what) {
  core::FlatReader in(data);
  for (const DatasetSpec& spec : dataset_specs()) {
    if (spec.is_optional && in.number() == 0) {
      continue;
    }
    Entry entry;
    entry.info = read_info(in, spec.path);
    if (what == Flattened::kArrays) {
      entry.data = in.bytes();
      if (entry.data.size() != entry.info.bytes) {
        throw_not_whole(spec.path);
      }
    } else {
      entry.chunks = read_chunks(in, spec.path);
    }
    entries_.emplace(spec.path, std::move(entry));
  }
  in.end();
}

const FlatDatabase::Entry& FlatDatabase::entry(const std::string& path) const {
  const auto found = entries_.find(path);
  CHECK(found != entries_.end());
  return found->second;
}

bool FlatDatabase::has(const std::string& path) { return entries_.contains(path); }

DatasetSource::Info FlatDatabase::info(const std::string& path) { return entry(path).info; }

std::vector<DatasetSource::Extent> FlatDatabase::chunks(const std::string& path) {
  return entry(path).chunks;
}

// All of it is in memory already, within the sandbox's limit.
void FlatDatabase::admit(const std::string&, const Info&) {}

void FlatDatabase::read(const std::string& path, const Info&, std::span<std::byte> out) {
  const std::span<const std::byte> data = entry(path).data;
  CHECK_EQ(data.size(), out.size());
  std::copy(data.begin(), data.end(), out.begin());
}

}  // namespace weft::storage
