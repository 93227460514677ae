#include <algorithm>
#include <fstream>
#include <system_error>

#include <spdlog/spdlog.h>

#include "coordinator/versions/catalogue.h"
#include "core/error.h"
#include "core/file_fault.h"
#include "core/folder.h"
#include "proto/names.h"
#include "storage/user_block.h"

// What the files of versions are made of: pieces, stored once, read with their digests checked, and
// mended.

namespace weft::coordinator {

namespace {

constexpr std::size_t kAssembledLimit = 4;

std::string text_of(const VersionRecord& version) {
  return version.fabric + "@" + std::to_string(version.number);
}

// Databases name the digest of what follows their user block.
bool is_intact(const std::filesystem::path& file, const VersionRecord& version) {
  std::error_code failure;
  if (std::filesystem::file_size(file, failure) != version.size_bytes || failure) {
    return false;
  }
  return core::digest_of_file(file, storage::kUserBlockBytes) == version.content_digest ||
         core::digest_of_file(file) == version.content_digest;
}

core::Error lost(const VersionRecord& version, const std::string& what) {
  const std::string how =
      version.carried_over_from.empty()
          ? "and the results that it was made from are not all there; submit the fabric again"
          : "and its light is nowhere else; recolor " + version.carried_over_from + " again";
  return {core::Code::kDataLoss, text_of(version) + " is damaged in the coordinator's folder: " +
                                     what + ", " + how + ", which mends it"};
}

}  // namespace

Catalogue::Catalogue(Journal& journal, const std::filesystem::path& state_folder)
    : journal_(journal.catalogue()),
      whole_files_(state_folder / "versions"),
      assembled_(state_folder / "assembled"),
      arriving_(state_folder / "arriving"),
      pieces_(state_folder / "pieces") {
  core::make_folder(whole_files_);
  std::error_code ignored;  // what stays is found again
  for (const std::filesystem::path& folder : {assembled_, arriving_}) {
    std::filesystem::remove_all(folder, ignored);
    core::make_folder(folder);
  }
  pieces_.remove_unfinished();
}

// Cuts a file and stores what is not there; durable on return.
std::vector<storage::Piece> Catalogue::store(const std::filesystem::path& file,
                                             std::uint64_t* shared_bytes) {
  storage::BlobStore::Batch batch(pieces_);
  std::set<core::Digest> own;
  std::vector<storage::Piece> pieces =
      storage::cut_file(file, [&](const storage::Piece& piece, std::string_view bytes) {
        const bool was_there = batch.put(piece.digest, bytes);
        const bool is_new_here = own.insert(piece.digest).second;
        if (shared_bytes != nullptr && was_there && is_new_here) {
          *shared_bytes += piece.size_bytes;
        }
      });
  batch.commit();
  return pieces;
}

std::filesystem::path Catalogue::new_arrival() {
  return arriving_ / (std::to_string(++arrivals_) + ".h5");
}

void Catalogue::prepare(Publication& publication) {
  publication.shared_bytes = 0;
  publication.pieces = store(publication.file, &publication.shared_bytes);
}

VersionRecord Catalogue::publish(const Publication& publication) {
  if (!v1::is_fabric_name(publication.fabric)) {
    throw core::Error(core::Code::kInvalidArgument,
                      "'" + publication.fabric + "' cannot be a fabric's name");
  }
  for (const storage::Piece& piece : publication.pieces) {
    if (!pieces_.use(piece.digest)) {
      throw core::Error(core::Code::kUnavailable,
                        "a piece of " + publication.fabric + " vanished while it was published");
    }
  }
  const std::lock_guard lock(publishing_);
  if (const auto step = journal_.step_of_request(publication.request_id)) {
    return find(step->fabric + "@" + std::to_string(step->number));
  }
  const std::vector<VersionRecord> versions = journal_.versions(publication.fabric);
  const std::uint64_t latest = journal_.latest_number(publication.fabric);
  std::error_code ignored;  // what stays of the file is wiped by the next start
  const auto same = std::find_if(versions.begin(), versions.end(), [&](const VersionRecord& v) {
    return v.content_digest == publication.content_digest &&
           (v.number == latest || (!v.job.empty() && v.job == publication.job));
  });
  if (same != versions.end()) {
    std::filesystem::remove(publication.file, ignored);
    return *same;
  }
  VersionRecord version;
  version.fabric = publication.fabric;
  version.number = versions.empty() ? 1 : versions.front().number + 1;
  version.content_digest = publication.content_digest;
  for (const storage::Piece& piece : publication.pieces) {
    version.size_bytes += piece.size_bytes;
  }
  version.file = version.fabric + "-" + std::to_string(version.number) + "-" +
                 version.content_digest.hex().substr(0, 12) + ".h5";
  version.job = publication.job;
  version.comment = publication.comment;
  version.published_at_ms = publication.now_ms;
  version.parent = latest;
  version.shared_bytes = publication.shared_bytes;
  version.cached_shards = publication.cached_shards;
  version.computed_shards = publication.computed_shards;
  version.user = publication.user;
  version.carried_over_from = publication.carried_over_from;
  journal_.publish(version, publication.pieces, publication.results, publication.request_id);
  std::filesystem::remove(publication.file, ignored);
  return version;
}

std::vector<storage::Piece> Catalogue::pieces_of(const VersionRecord& version) {
  std::optional<std::vector<storage::Piece>> pieces =
      journal_.pieces_of(version.fabric, version.number);
  if (pieces) {
    return *std::move(pieces);
  }
  const std::lock_guard lock(mending_);
  return cut_whole_file(version);
}

// REQUIRES: mending_ is held.
std::vector<storage::Piece> Catalogue::cut_whole_file(const VersionRecord& version) {
  std::optional<std::vector<storage::Piece>> pieces =
      journal_.pieces_of(version.fabric, version.number);
  const std::filesystem::path path = whole_files_ / version.file;
  if (!pieces) {
    std::filesystem::path source = path;
    if (!is_intact(path, version)) {
      const std::optional<std::filesystem::path> remade = remake_ ? remake_(version) : std::nullopt;
      if (!remade) {
        throw lost(version, "its file is gone or damaged");
      }
      source = *remade;
    }
    pieces = store(source, nullptr);
    journal_.set_pieces(version.fabric, version.number, *pieces);
    (void)core::file_system::remove(source);  // what stays is wiped by the next start
    spdlog::info("version={} event=cut pieces={}", text_of(version), pieces->size());
  }
  (void)core::file_system::remove(path);  // it may be gone already
  return *std::move(pieces);
}

std::string Catalogue::piece_of(const VersionRecord& version, const core::Digest& digest) {
  std::optional<std::string> bytes = pieces_.get(digest);
  if (!bytes) {
    mend(version, digest);
    bytes = pieces_.get(digest);
  }
  if (!bytes) {
    throw lost(version, "the piece " + digest.hex().substr(0, 12) + " is lost");
  }
  return *std::move(bytes);
}

void Catalogue::mend(const VersionRecord& version, const core::Digest& digest) {
  const std::lock_guard one_at_a_time(mending_);
  if (pieces_.has(digest) || !remake_) {
    return;  // mended meanwhile, or nobody can
  }
  spdlog::warn("version={} event=damaged piece={}", text_of(version), digest.hex());
  const std::optional<std::filesystem::path> file = remake_(version);
  if (!file) {
    return;
  }
  (void)store(*file, nullptr);
  std::error_code ignored;  // what stays is wiped by the next start
  std::filesystem::remove(*file, ignored);
  spdlog::info("version={} event=mended", text_of(version));
}

std::string Catalogue::read_piece(const core::Digest& digest) {
  std::optional<std::string> bytes = pieces_.get(digest);
  if (bytes) {
    return *std::move(bytes);
  }
  std::optional<VersionRecord> owner;
  journal_.visit_pieces([&](const std::string& fabric, std::uint64_t number,
                            const std::vector<storage::Piece>& pieces) {
    const auto is_it = [&](const storage::Piece& piece) { return piece.digest == digest; };
    if (!owner && std::any_of(pieces.begin(), pieces.end(), is_it)) {
      owner.emplace();
      owner->fabric = fabric;
      owner->number = number;
    }
  });
  if (!owner) {
    throw core::Error(core::Code::kNotFound, "no version has a piece " + digest.hex());
  }
  return piece_of(find(text_of(*owner)), digest);
}

void Catalogue::read(const VersionRecord& version, std::uint64_t offset, const Sink& sink) {
  std::uint64_t at = 0;
  for (const storage::Piece& piece : pieces_of(version)) {
    if (at + piece.size_bytes > offset) {
      const std::string bytes = piece_of(version, piece.digest);
      const std::uint64_t skipped = offset > at ? offset - at : 0;
      if (!sink(std::string_view(bytes).substr(static_cast<std::size_t>(skipped)))) {
        return;
      }
    }
    at += piece.size_bytes;
  }
}

std::filesystem::path Catalogue::assemble(const VersionRecord& version) {
  std::filesystem::path path = assembled_ / (version.content_digest.hex() + ".h5");
  std::error_code failure;
  if (std::filesystem::file_size(path, failure) == version.size_bytes && !failure) {
    std::filesystem::last_write_time(path, std::filesystem::file_time_type::clock::now(), failure);
    return path;
  }
  const std::filesystem::path beside = path.string() + ".part";
  {
    std::ofstream file(beside, std::ios::binary | std::ios::trunc);
    read(version, 0, [&](std::string_view bytes) {
      file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
      return static_cast<bool>(file);
    });
    file.close();
    if (!file) {
      throw core::Error(core::Code::kUnavailable, "cannot write " + beside.string());
    }
  }
  std::filesystem::rename(beside, path);
  return path;
}

void Catalogue::with_files(const std::vector<VersionRecord>& versions, const UseFiles& use) {
  const std::lock_guard lock(assembling_);
  std::vector<std::filesystem::path> files;
  for (const VersionRecord& version : versions) {
    files.push_back(assemble(version));
  }
  use(files);
  trim_assembled(files);
}

void Catalogue::trim_assembled(const std::vector<std::filesystem::path>& kept) const {
  std::vector<std::pair<std::filesystem::file_time_type, std::filesystem::path>> files;
  std::error_code failure;
  for (const auto& item : std::filesystem::directory_iterator(assembled_, failure)) {
    files.emplace_back(item.last_write_time(failure), item.path());
  }
  std::sort(files.begin(), files.end());
  for (std::size_t i = 0; i + kAssembledLimit < files.size(); ++i) {
    if (std::find(kept.begin(), kept.end(), files[i].second) == kept.end()) {
      std::filesystem::remove(files[i].second, failure);
    }
  }
}

// REQUIRES: mending_ is not held.
void Catalogue::cut_whole_files() {
  for (const VersionRecord& latest : journal_.latest_versions()) {
    for (const VersionRecord& version : journal_.versions(latest.fabric)) {
      const std::lock_guard lock(mending_);
      if (!std::filesystem::exists(whole_files_ / version.file)) {
        continue;
      }
      try {
        (void)cut_whole_file(version);
      } catch (const core::Error& error) {
        spdlog::warn("version={} event=not_cut message=\"{}\"", text_of(version), error.what());
      }
    }
  }
}

std::set<core::Digest> Catalogue::needed_pieces(bool may_cut) {
  if (may_cut) {
    cut_whole_files();
  }
  std::set<core::Digest> needed;
  journal_.visit_pieces([&](const std::string& /*fabric*/, std::uint64_t /*number*/,
                            const std::vector<storage::Piece>& pieces) {
    for (const storage::Piece& piece : pieces) {
      needed.insert(piece.digest);
    }
  });
  return needed;
}

}  // namespace weft::coordinator
