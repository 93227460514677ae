#include "coordinator/versions/catalogue.h"

#include <algorithm>
#include <charconv>

#include "core/error.h"
#include "proto/names.h"

// References, tags and history; what the versions' files are made of is in version_files.cpp.

namespace weft::coordinator {

namespace {

std::string names_of(const std::vector<VersionRecord>& fabrics) {
  std::string names;
  for (const VersionRecord& fabric : fabrics) {
    names += (names.empty() ? "" : ", ") + fabric.fabric;
  }
  return names.empty() ? "no fabric at all is published yet" : "published are: " + names;
}

std::string tags_of(const std::vector<VersionRecord>& versions) {
  std::string tags;
  for (const VersionRecord& version : versions) {
    for (const std::string& tag : version.tags) {
      tags += (tags.empty() ? "" : ", ") + tag;
    }
  }
  return tags.empty() ? "it has no tags" : "its tags are: " + tags;
}

const VersionRecord* find_number(const std::vector<VersionRecord>& versions, std::uint64_t number) {
  const auto found = std::find_if(versions.begin(), versions.end(),
                                  [&](const VersionRecord& v) { return v.number == number; });
  return found == versions.end() ? nullptr : &*found;
}

const VersionRecord* find_tag(const std::vector<VersionRecord>& versions, const std::string& tag) {
  const auto found =
      std::find_if(versions.begin(), versions.end(), [&](const VersionRecord& version) {
        return std::find(version.tags.begin(), version.tags.end(), tag) != version.tags.end();
      });
  return found == versions.end() ? nullptr : &*found;
}

HistoryRecord step_of(const VersionRecord& version, const char* action, const std::string& tag,
                      const CatalogueOrder& order) {
  return {version.fabric, order.now_ms,  action,          version.number, tag,
          order.user,     order.comment, order.request_id};
}

}  // namespace

VersionRecord Catalogue::find(const std::string& reference) const {
  const std::size_t at = reference.find_first_of("@:");
  const std::string name = reference.substr(0, at);
  const bool names_tag = at != std::string::npos && reference[at] == ':';
  const std::string which = at == std::string::npos ? "latest" : reference.substr(at + 1);
  std::uint64_t number = 0;
  const auto parsed = std::from_chars(which.data(), which.data() + which.size(), number);
  const bool names_number =
      !names_tag && parsed.ec == std::errc() && parsed.ptr == which.data() + which.size();
  const bool is_good = names_tag ? v1::is_tag(which) : names_number || which == "latest";
  if (!v1::is_fabric_name(name) || !is_good) {
    throw core::Error(core::Code::kInvalidArgument,
                      "'" + reference +
                          "' names no version; write NAME, NAME@latest, NAME@NUMBER or NAME:TAG, "
                          "where NAME is of a-z, 0-9, _ and -");
  }
  // The number first: what it names is among the versions that are listed then, whatever is
  // published in between.
  const std::uint64_t latest = journal_.latest_number(name);
  const std::vector<VersionRecord> versions =
      latest == 0 ? std::vector<VersionRecord>() : journal_.versions(name);
  if (versions.empty()) {
    throw core::Error(core::Code::kNotFound, "there is no fabric named '" + name + "'; " +
                                                 names_of(journal_.latest_versions()));
  }
  const VersionRecord* const found =
      names_tag ? find_tag(versions, which) : find_number(versions, names_number ? number : latest);
  if (found == nullptr) {
    throw core::Error(core::Code::kNotFound,
                      names_tag
                          ? "fabric '" + name + "' has no tag '" + which + "'; " + tags_of(versions)
                          : "fabric '" + name + "' has no version " + which + "; its latest is " +
                                std::to_string(latest));
  }
  return *found;
}

std::vector<VersionRecord> Catalogue::versions(const std::string& fabric) const {
  return journal_.versions(fabric);
}

std::vector<VersionRecord> Catalogue::latest_versions() const { return journal_.latest_versions(); }

std::optional<VersionRecord> Catalogue::done_before(const CatalogueOrder& order) const {
  const std::optional<HistoryRecord> step = journal_.step_of_request(order.request_id);
  return step ? std::optional(find(step->fabric + "@" + std::to_string(step->number)))
              : std::nullopt;
}

VersionRecord Catalogue::tag(const std::string& reference, const std::string& tag,
                             const CatalogueOrder& order) {
  if (!v1::is_tag(tag)) {
    throw core::Error(
        core::Code::kInvalidArgument,
        "'" + tag +
            "' is no tag; a tag is 1 to 64 characters of a-z, 0-9, _, . and -, begins "
            "with a letter or digit, and is neither a number nor 'latest'");
  }
  if (const std::optional<VersionRecord> before = done_before(order)) {
    return *before;
  }
  const VersionRecord version = find(reference);
  journal_.set_tag(step_of(version, "tagged", tag, order));
  return find(version.fabric + "@" + std::to_string(version.number));
}

VersionRecord Catalogue::untag(const std::string& fabric, const std::string& tag,
                               const CatalogueOrder& order) {
  if (const std::optional<VersionRecord> before = done_before(order)) {
    return *before;
  }
  const VersionRecord version = find(fabric + ":" + tag);
  journal_.remove_tag(step_of(version, "untagged", tag, order));
  return find(version.fabric + "@" + std::to_string(version.number));
}

VersionRecord Catalogue::roll_back(const std::string& reference, const CatalogueOrder& order) {
  if (const std::optional<VersionRecord> before = done_before(order)) {
    return *before;
  }
  const VersionRecord version = find(reference);
  const std::lock_guard lock(publishing_);
  journal_.set_latest(step_of(version, "rolled_back", {}, order));
  return version;
}

std::vector<HistoryRecord> Catalogue::history(const std::string& fabric, std::size_t limit) const {
  return journal_.history(fabric, limit);
}

std::set<core::Digest> Catalogue::published_results() const { return journal_.published_results(); }

}  // namespace weft::coordinator
