#include "coordinator/catalogue.h"

#include <algorithm>
#include <charconv>

#include "core/error.h"
#include "core/file.h"

namespace weft::coordinator {

namespace {

std::string names_of(const std::vector<VersionRecord>& fabrics) {
  std::string names;
  for (const VersionRecord& fabric : fabrics) {
    names += (names.empty() ? "" : ", ") + fabric.fabric;
  }
  return names.empty() ? "no fabric at all is published yet" : "published are: " + names;
}

}  // namespace

bool is_fabric_name(const std::string& name) {
  const auto is_word = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); };
  return !name.empty() && name.size() <= 64 && is_word(name.front()) &&
         std::all_of(name.begin(), name.end(),
                     [&](char c) { return is_word(c) || c == '_' || c == '-'; });
}

Catalogue::Catalogue(Journal& journal, std::filesystem::path folder)
    : journal_(journal), folder_(std::move(folder)) {
  std::filesystem::create_directories(folder_);
}

VersionRecord Catalogue::publish(const Publication& publication) {
  if (!is_fabric_name(publication.fabric)) {
    throw core::Error(core::Code::kInvalidArgument,
                      "'" + publication.fabric + "' cannot be a fabric's name");
  }
  const std::lock_guard lock(publishing_);
  const std::vector<VersionRecord> versions = journal_.catalogue().versions(publication.fabric);
  if (!versions.empty() && versions.front().content_digest == publication.content_digest) {
    std::filesystem::remove(publication.file);
    return versions.front();
  }
  VersionRecord version;
  version.fabric = publication.fabric;
  version.number = versions.empty() ? 1 : versions.front().number + 1;
  version.content_digest = publication.content_digest;
  version.size_bytes = std::filesystem::file_size(publication.file);
  version.file = version.fabric + "-" + std::to_string(version.number) + "-" +
                 version.content_digest.hex().substr(0, 12) + ".h5";
  version.job = publication.job;
  version.comment = publication.comment;
  version.published_at_ms = publication.now_ms;
  core::publish_file(publication.file, path_of(version));
  journal_.catalogue().add_version(version);
  return version;
}

VersionRecord Catalogue::find(const std::string& reference) const {
  const std::size_t at = reference.find('@');
  const std::string name = reference.substr(0, at);
  const std::string which = at == std::string::npos ? "latest" : reference.substr(at + 1);
  std::uint64_t number = 0;
  const auto parsed = std::from_chars(which.data(), which.data() + which.size(), number);
  const bool is_number = parsed.ec == std::errc() && parsed.ptr == which.data() + which.size();
  if (!is_fabric_name(name) || (which != "latest" && !is_number)) {
    throw core::Error(core::Code::kInvalidArgument,
                      "'" + reference +
                          "' names no version; write NAME, NAME@latest or NAME@NUMBER, where NAME "
                          "is of a-z, 0-9, _ and -");
  }
  const std::vector<VersionRecord> versions = journal_.catalogue().versions(name);
  if (versions.empty()) {
    throw core::Error(core::Code::kNotFound, "there is no fabric named '" + name + "'; " +
                                                 names_of(journal_.catalogue().latest_versions()));
  }
  if (!is_number) {
    return versions.front();
  }
  for (const VersionRecord& version : versions) {
    if (version.number == number) {
      return version;
    }
  }
  throw core::Error(core::Code::kNotFound, "fabric '" + name + "' has no version " + which +
                                               "; its latest is " +
                                               std::to_string(versions.front().number));
}

std::vector<VersionRecord> Catalogue::versions(const std::string& fabric) const {
  return journal_.catalogue().versions(fabric);
}

std::vector<VersionRecord> Catalogue::latest_versions() const {
  return journal_.catalogue().latest_versions();
}

std::filesystem::path Catalogue::path_of(const VersionRecord& version) const {
  return folder_ / version.file;
}

}  // namespace weft::coordinator
