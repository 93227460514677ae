#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include "coordinator/journal.h"
#include "core/digest.h"

namespace weft::coordinator {

// A database that is complete and waits to be published.
struct Publication {
  std::string fabric;
  core::Digest content_digest;
  std::filesystem::path file;  // in the catalogue's file system; it is moved
  std::string job;
  std::string comment;
  std::int64_t now_ms = 0;
};

// The published versions: immutable files in one folder, and their rows in the journal. A row is
// added only when its file stands under its final name, so whoever finds a version finds its file;
// a file without a row (the process died between the two) is replaced by the next publication.
// Any thread may call anything.
class Catalogue {
 public:
  // Creates `folder` where needed. `journal` must outlive the catalogue.
  Catalogue(Journal& journal, std::filesystem::path folder);

  // Makes the next version of the fabric. When the latest version has the same content digest, no
  // new one is made: the file is dropped and that version returned, so that repeating a job, or a
  // publication whose answer was lost, changes nothing. Equal content of an older version does get
  // a new number: going back is a step of its own in a fabric's history.
  VersionRecord publish(const Publication& publication);

  // "silk@3", "silk@latest" or "silk". Throws core::Error(kInvalidArgument) when it is no
  // reference, kNotFound, saying what there is, when nothing has that name or number.
  [[nodiscard]] VersionRecord find(const std::string& reference) const;
  [[nodiscard]] std::vector<VersionRecord> versions(const std::string& fabric) const;
  [[nodiscard]] std::vector<VersionRecord> latest_versions() const;
  [[nodiscard]] std::filesystem::path path_of(const VersionRecord& version) const;

 private:
  Journal& journal_;
  std::filesystem::path folder_;
  std::mutex publishing_;
};

// Whether `name` is a fabric's name, [a-z0-9][a-z0-9_-]{0,63}: checked wherever one comes from
// outside, because names become paths.
[[nodiscard]] bool is_fabric_name(const std::string& name);

}  // namespace weft::coordinator
