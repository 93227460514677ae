#include <algorithm>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/file.h"
#include "core/input_file.h"
#include "core/sandbox.h"
#include "storage/database_contents.h"
#include "storage/database_parser.h"
#include "storage/database_schema.h"
#include "storage/database_summary.h"
#include "storage/fabric_database.h"
#include "storage/flat_database.h"
#include "storage/h5_reader.h"
#include "storage/recolouring.h"
#include "storage/user_block.h"

namespace weft::storage {

namespace {

UserBlock user_block_of(const core::InputFile& file) {
  return parse_user_block(file.read(0, kUserBlockBytes), file.size_bytes(), file.name());
}

// Nothing reaches a parser before the digest holds.
core::Digest check_digest(const core::InputFile& file) {
  const UserBlock block = user_block_of(file);
  if (file.digest(kUserBlockBytes) != block.digest) {
    throw core::Error(core::Code::kDataLoss,
                      file.name() +
                          " is damaged: its bytes do not have the digest it was written with; "
                          "fetch or make it again");
  }
  return block.digest;
}

// Chunks while they are unfolded, the largest dataset, and the file itself.
core::SandboxLimits limits_for(std::uint64_t file_bytes) {
  constexpr std::uint64_t kSlowestBytesPerSecond = std::uint64_t{8} << 20;
  constexpr std::uint64_t kStartSeconds = 10;
  constexpr std::uint64_t kFormBytes = std::uint64_t{1} << 20;
  const std::uint64_t decoded_bytes = h5::decoded_limit_bytes(file_bytes);
  core::SandboxLimits limits;
  limits.memory_bytes = file_bytes + decoded_bytes + 4 * h5::kChunkLimitBytes;
  limits.answer_bytes = decoded_bytes + kFormBytes;
  limits.cpu_s = kStartSeconds + decoded_bytes / kSlowestBytesPerSecond;
  return limits;
}

core::SandboxAnswer flattened(const core::InputFile& file, Flattened what) {
  return core::read_in_sandbox(
      file, {kDatabaseRequest, what == Flattened::kArrays ? kArraysRequest : kShapesRequest},
      limits_for(file.size_bytes()));
}

RecolourableDatabase read_checked(const core::InputFile& file) {
  const core::SandboxAnswer answer = flattened(file, Flattened::kArrays);
  FlatDatabase source(answer.bytes(), Flattened::kArrays);
  return read_all_contents(source);
}

template <class Function>
auto naming_file(const std::string& name, Function function) {
  try {
    return function();
  } catch (const core::Error& error) {
    const std::string what = error.what();
    if (what.find(name) != std::string::npos) {
      throw;
    }
    throw core::Error(error.code(), name + ": " + what);
  }
}

}  // namespace

FabricDatabase read_database(const std::filesystem::path& path) {
  return std::move(read_recolourable(path).database);
}

RecolourableDatabase read_recolourable(const std::filesystem::path& path) {
  return naming_file(path.string(), [&path] {
    const core::InputFile file(path);
    check_digest(file);
    return read_checked(file);
  });
}

core::Digest verify_database(const std::filesystem::path& path) {
  return naming_file(path.string(), [&path] {
    const core::InputFile file(path);
    const core::Digest digest = check_digest(file);
    std::ignore = read_checked(file);
    return digest;
  });
}

core::Digest checked_digest(const std::filesystem::path& path) {
  return naming_file(path.string(), [&path] { return check_digest(core::InputFile(path)); });
}

core::Digest content_digest(const std::filesystem::path& path) {
  return user_block_of(core::InputFile(path)).digest;
}

std::vector<StoredDataset> stored_datasets(const std::filesystem::path& path) {
  return naming_file(path.string(), [&path] {
    const core::InputFile file(path);
    check_digest(file);
    const core::SandboxAnswer answer = flattened(file, Flattened::kShapes);
    FlatDatabase source(answer.bytes(), Flattened::kShapes);
    Extents extents;
    std::vector<StoredDataset> datasets;
    for (const DatasetSpec& spec : dataset_specs()) {
      if (!source.has(spec.path)) {
        continue;
      }
      const DatasetSource::Info info = source.info(spec.path);
      extents.bind(spec, info.shape);
      datasets.push_back({spec.path, h5::to_string(info.element), info.shape, info.stored_bytes});
    }
    return datasets;
  });
}

std::vector<StoredChunk> stored_chunks(const std::filesystem::path& path) {
  return naming_file(path.string(), [&path] {
    const core::InputFile file(path);
    check_digest(file);
    const core::SandboxAnswer answer = flattened(file, Flattened::kShapes);
    FlatDatabase source(answer.bytes(), Flattened::kShapes);
    const std::uint64_t body_bytes = file.size_bytes() - kUserBlockBytes;
    std::vector<StoredChunk> chunks;
    for (const DatasetSpec& spec : dataset_specs()) {
      if (!source.has(spec.path)) {
        continue;
      }
      for (const DatasetSource::Extent& extent : source.chunks(spec.path)) {
        if (extent.offset > body_bytes || extent.size_bytes > body_bytes - extent.offset) {
          throw core::Error(core::Code::kDataLoss, std::string("dataset ") + spec.path +
                                                       " has chunks that lie outside the file; "
                                                       "fetch or make it again");
        }
        chunks.push_back({extent.offset + kUserBlockBytes, extent.size_bytes});
      }
    }
    std::sort(chunks.begin(), chunks.end(),
              [](const StoredChunk& a, const StoredChunk& b) { return a.offset < b.offset; });
    return chunks;
  });
}

}  // namespace weft::storage
