#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/journal/journal.h"
#include "core/digest.h"
#include "storage/blob_store.h"
#include "storage/pieces.h"

namespace weft::coordinator {

// A database that is complete and waits to be published.
struct Publication {
  std::string fabric;
  core::Digest content_digest;
  std::filesystem::path file;  // in the catalogue's file system; it is taken
  std::string job;
  std::string comment;
  std::int64_t now_ms = 0;
  std::string user;
  std::uint64_t cached_shards = 0;
  std::uint64_t computed_shards = 0;
  std::vector<core::Digest> results;   // it was made from
  std::vector<storage::Piece> pieces;  // see Catalogue::prepare
  std::uint64_t shared_bytes = 0;
  std::string carried_over_from;  // see VersionRecord
  std::string request_id;         // of the call that publishes it; empty: none
};

// Who does something to the catalogue, when and why. A call that is repeated with the same
// request_id changes nothing more.
struct CatalogueOrder {
  std::string request_id;
  std::string user;
  std::string comment;
  std::int64_t now_ms = 0;
};

// The published versions: rows in the journal, and the pieces of their files in a store of blobs,
// where versions share what is equal. A version is added in one transaction, when all its pieces
// are on the disk, so whoever finds a version finds its pieces; pieces without a version (the
// process died between the two) wait for the next publication or for the garbage collector.
// Versions of an older weft are whole files in versions/ until somebody asks for their pieces.
// Any thread may call anything.
class Catalogue {
 public:
  // Makes pieces/, versions/, assembled/ and arriving/ in `state_folder` where needed. `journal`
  // must outlive the catalogue.
  Catalogue(Journal& journal, const std::filesystem::path& state_folder);

  // Makes the file of a version again, from the results that it was made from, or gives nothing
  // when they are gone. Set once, before other threads call.
  using Remake = std::function<std::optional<std::filesystem::path>(const VersionRecord& version)>;
  void set_remake(Remake remake) { remake_ = std::move(remake); }

  // The long part of publishing: cuts the file and stores its pieces. Nobody sees anything of it.
  void prepare(Publication& publication);
  // Makes the next version of the fabric, and the latest. REQUIRES: prepared. When the latest
  // version has the same content digest, or this job or call has published that content before, no
  // new one is made: that version is returned, so that repeating a job, or a publication whose
  // answer was lost, changes nothing (but a damaged piece of it is mended). Equal content of an
  // older version does get a new number: going back is a step of its own in a fabric's history.
  VersionRecord publish(const Publication& publication);

  // What an order that was carried out before was about.
  [[nodiscard]] std::optional<VersionRecord> done_before(const CatalogueOrder& order) const;
  // A name for a file that is to be published, of nobody else; what is left there is wiped at the
  // next start.
  [[nodiscard]] std::filesystem::path new_arrival();

  // "silk@3", "silk:approved", "silk@latest" or "silk". Throws core::Error(kInvalidArgument) when
  // it is no reference, kNotFound, saying what there is, when nothing has that name, number or tag.
  [[nodiscard]] VersionRecord find(const std::string& reference) const;
  [[nodiscard]] std::vector<VersionRecord> versions(const std::string& fabric) const;
  [[nodiscard]] std::vector<VersionRecord> latest_versions() const;

  // Gives a version a tag, or moves the tag to it. Throws core::Error(kInvalidArgument) when it is
  // no tag, else as find.
  VersionRecord tag(const std::string& reference, const std::string& tag,
                    const CatalogueOrder& order);
  // Returns what the tag named. Throws core::Error(kNotFound) when nothing has that tag.
  VersionRecord untag(const std::string& fabric, const std::string& tag,
                      const CatalogueOrder& order);
  VersionRecord roll_back(const std::string& reference, const CatalogueOrder& order);
  [[nodiscard]] std::vector<HistoryRecord> history(const std::string& fabric,
                                                   std::size_t limit) const;

  // The pieces whose bytes in their order are the version's file.
  [[nodiscard]] std::vector<storage::Piece> pieces_of(const VersionRecord& version);
  // A piece of some version, remade where it is damaged. Throws core::Error(kNotFound) when no
  // version has it, kDataLoss naming the version when it is lost.
  [[nodiscard]] std::string read_piece(const core::Digest& digest);
  // Calls `sink` with the bytes of the version's file from `offset` on, piece by piece, until it
  // returns false. Throws core::Error(kDataLoss) naming the version when a piece is lost.
  using Sink = std::function<bool(std::string_view bytes)>;
  void read(const VersionRecord& version, std::uint64_t offset, const Sink& sink);
  // Calls `use` with the whole file of each version. The files are put together for the occasion;
  // a few are kept for the next one.
  using UseFiles = std::function<void(const std::vector<std::filesystem::path>& files)>;
  void with_files(const std::vector<VersionRecord>& versions, const UseFiles& use);

  // For the garbage collector: where the pieces are, all that versions have (after cutting whole
  // files, when it `may_cut`), and the results that versions were made from.
  [[nodiscard]] const storage::BlobStore& pieces() const { return pieces_; }
  [[nodiscard]] std::set<core::Digest> needed_pieces(bool may_cut);
  [[nodiscard]] std::set<core::Digest> published_results() const;

 private:
  [[nodiscard]] std::vector<storage::Piece> store(const std::filesystem::path& file,
                                                  std::uint64_t* shared_bytes);
  [[nodiscard]] std::vector<storage::Piece> cut_whole_file(const VersionRecord& version);
  void cut_whole_files();
  [[nodiscard]] std::string piece_of(const VersionRecord& version, const core::Digest& digest);
  void mend(const VersionRecord& version, const core::Digest& digest);
  [[nodiscard]] std::filesystem::path assemble(const VersionRecord& version);
  void trim_assembled(const std::vector<std::filesystem::path>& kept) const;

  JournalCatalogue& journal_;
  std::filesystem::path whole_files_;
  std::filesystem::path assembled_;
  std::filesystem::path arriving_;
  std::atomic<std::uint64_t> arrivals_{0};
  storage::BlobStore pieces_;
  Remake remake_;
  std::mutex publishing_;  // numbers are given one at a time
  std::mutex mending_;     // files are cut and remade one at a time
  std::mutex assembling_;  // whole files are read by one caller at a time
};

}  // namespace weft::coordinator
