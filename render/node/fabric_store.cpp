#include "render/node/fabric_store.h"

#include <algorithm>
#include <utility>

#include "core/error.h"
#include "storage/database_summary.h"

namespace weft::render {
namespace {

// Embree's structure and our own tables beside the arrays; measured: 130 bytes a segment for
// fabrics of 2,000 to 22,000 segments.
constexpr std::uint64_t kTracingBytesPerSegment = 256;

std::string mib(std::uint64_t bytes) {
  return std::to_string((bytes + (1 << 20) - 1) >> 20) + " MiB";
}

std::uint64_t element_bytes(const std::string& element) {
  // Halves of transfer matrices are floats in memory.
  return element == "u64" || element == "i64" || element == "f64" ? 8 : 4;
}

}  // namespace

std::uint64_t fabric_memory_bytes(const std::filesystem::path& database) {
  std::uint64_t bytes = 0;
  for (const storage::StoredDataset& dataset : storage::stored_datasets(database)) {
    std::uint64_t elements = 1;
    for (const std::uint64_t side : dataset.shape) {
      elements *= side;
    }
    bytes += elements * element_bytes(dataset.element);
    if (dataset.path == "/cells/cell_of_segment") {
      bytes += elements * kTracingBytesPerSegment;
    }
  }
  return bytes;
}

FabricStore::FabricStore(const security::Endpoint& coordinator, client::FabricCache cache,
                         std::uint64_t memory_limit_bytes)
    : coordinator_(coordinator),
      cache_(std::move(cache)),
      memory_limit_bytes_(memory_limit_bytes) {}

void FabricStore::reserve(std::uint64_t bytes, const std::string& what) {
  if (bytes > memory_limit_bytes_) {
    throw core::Error(core::Code::kResourceExhausted,
                      what + " needs " + mib(bytes) + " of memory, and the node may use " +
                          mib(memory_limit_bytes_) +
                          "; ask for a smaller picture or fewer layers and files");
  }
  for (Resident& resident : residents_) {
    resident.in_use = false;
  }
  reserved_bytes_ = bytes;
  make_room(0);
}

void FabricStore::make_room(std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  std::uint64_t total_bytes = reserved_bytes_ + bytes;
  for (const Resident& resident : residents_) {
    total_bytes += resident.bytes;
  }
  for (auto at = residents_.end(); at != residents_.begin() && total_bytes > memory_limit_bytes_;) {
    --at;
    if (!at->in_use) {
      total_bytes -= at->bytes;
      at = residents_.erase(at);
    }
  }
}

FabricStore::Resident* FabricStore::find(const std::string& digest, Fabric::Wanted wanted) {
  const std::lock_guard lock(mutex_);
  const auto found = std::find_if(residents_.begin(), residents_.end(), [&](const Resident& r) {
    return r.digest == digest && r.wanted == wanted;
  });
  if (found == residents_.end()) {
    return nullptr;
  }
  residents_.splice(residents_.begin(), residents_, found);
  return &residents_.front();
}

std::filesystem::path FabricStore::fetch(const v1::Version& version,
                                         const client::FetchReport& report) {
  try {
    return cache_.fetch(coordinator_, version, report);
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kDataLoss) {
      throw;
    }
  }
  return cache_.fetch(coordinator_, version, report);  // what was damaged is gone: once more
}

const LoadedFabric& FabricStore::take(const std::string& reference, Fabric::Wanted wanted,
                                      const client::FetchReport& report) {
  const v1::Version version = client::find_version(coordinator_, reference);
  const std::string digest = client::version_digest(version).hex();
  if (Resident* resident = find(digest, wanted)) {
    resident->in_use = true;
    return resident->fabric;
  }
  const auto refuse = [&](std::uint64_t bytes) {
    throw core::Error(core::Code::kResourceExhausted,
                      client::reference_text(version) + " needs " + mib(bytes) +
                          " of memory beside the " + mib(reserved_bytes_) +
                          " of the pictures and the order's other fabrics, and the node may use " +
                          mib(memory_limit_bytes_) +
                          "; ask for a smaller picture, or another node");
  };
  const auto used_bytes = [&] {
    std::uint64_t bytes = reserved_bytes_;
    for (const Resident& resident : residents_) {
      bytes += resident.in_use ? resident.bytes : 0;
    }
    return bytes;
  };
  // The file is compressed: what exceeds the limit on disk does so in memory.
  if (version.size_bytes() > memory_limit_bytes_ - std::min(memory_limit_bytes_, used_bytes())) {
    refuse(version.size_bytes());
  }
  const std::filesystem::path path = fetch(version, report);
  const std::uint64_t bytes = fabric_memory_bytes(path);
  if (bytes > memory_limit_bytes_ - std::min(memory_limit_bytes_, used_bytes())) {
    refuse(bytes);
  }
  make_room(bytes);
  Resident resident{digest, wanted, load_fabric(path, wanted), bytes, true};
  const std::lock_guard lock(mutex_);
  residents_.push_front(std::move(resident));
  return residents_.front().fabric;
}

std::vector<std::string> FabricStore::resident() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> digests;
  for (const Resident& resident : residents_) {
    digests.push_back(resident.digest);
  }
  return digests;
}

std::uint64_t FabricStore::resident_bytes() const {
  const std::lock_guard lock(mutex_);
  std::uint64_t bytes = 0;
  for (const Resident& resident : residents_) {
    bytes += resident.bytes;
  }
  return bytes;
}

}  // namespace weft::render
