#include "cli/fabric_reference.h"

#include <algorithm>
#include <cstdlib>
#include <system_error>
#include <utility>
#include <vector>

#include "cli/client.h"
#include "client/fetch_version.h"
#include "core/error.h"

namespace weft::cli {

namespace {

constexpr std::size_t kNameLimit = 64;
constexpr std::size_t kDigitsLimit = 18;
constexpr std::uint64_t kCacheLimitBytes = std::uint64_t{16} << 30;

bool is_name(std::string_view text) {
  const auto is_plain = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); };
  return !text.empty() && text.size() <= kNameLimit && is_plain(text.front()) &&
         std::all_of(text.begin(), text.end(),
                     [&](char c) { return is_plain(c) || c == '_' || c == '-'; });
}

// Removes the databases that were fetched longest ago until the cache keeps its limit. `kept`
// stays.
void trim_cache(const std::filesystem::path& folder, const std::filesystem::path& kept) {
  struct Entry {
    std::filesystem::file_time_type fetched_at;
    std::filesystem::path path;
    std::uint64_t size_bytes;
  };
  std::vector<Entry> entries;
  std::uint64_t total_bytes = 0;
  std::error_code failure;
  for (const auto& item : std::filesystem::directory_iterator(folder, failure)) {
    std::error_code gone;  // another process may trim at the same time
    const std::uint64_t size_bytes = item.file_size(gone);
    const auto fetched_at = item.last_write_time(gone);
    if (!gone && item.path() != kept) {
      entries.push_back({fetched_at, item.path(), size_bytes});
      total_bytes += size_bytes;
    }
  }
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return a.fetched_at < b.fetched_at; });
  for (const Entry& entry : entries) {
    if (total_bytes <= kCacheLimitBytes) {
      return;
    }
    std::error_code gone;
    std::filesystem::remove(entry.path, gone);
    total_bytes -= entry.size_bytes;
  }
}

// $XDG_CACHE_HOME/weft, else ~/.cache/weft; empty when neither is set.
std::filesystem::path cache_folder() {
  // No other thread changes the environment: weft never does.
  const char* cache = std::getenv("XDG_CACHE_HOME");  // NOLINT(concurrency-mt-unsafe)
  if (cache != nullptr && *cache == '/') {
    return std::filesystem::path(cache) / "weft";
  }
  const char* home = std::getenv("HOME");  // NOLINT(concurrency-mt-unsafe)
  if (home == nullptr || *home == '\0') {
    return {};
  }
  return std::filesystem::path(home) / ".cache" / "weft";
}

}  // namespace

std::optional<FabricReference> parse_reference(std::string_view text) {
  const std::size_t at = text.find('@');
  const std::string_view name = text.substr(0, at);
  if (!is_name(name)) {
    return std::nullopt;
  }
  FabricReference reference{std::string(name), std::nullopt};
  if (at == std::string_view::npos || text.substr(at) == "@latest") {
    return reference;
  }
  const std::string_view number = text.substr(at + 1);
  if (number.empty() || number.size() > kDigitsLimit || number.front() == '0' ||
      number.find_first_not_of("0123456789") != std::string_view::npos) {
    return std::nullopt;
  }
  reference.version = std::stoull(std::string(number));
  return reference;
}

std::filesystem::path fabric_cache_folder() {
  const std::filesystem::path folder = cache_folder();
  if (folder.empty()) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "there is no folder for fetched fabrics: neither XDG_CACHE_HOME nor HOME is "
                      "set; set one, or fetch the file with 'weft fetch' and name its path");
  }
  return folder / "fabrics";
}

std::filesystem::path environment_cache_folder() {
  const std::filesystem::path folder = cache_folder();
  return folder.empty() ? folder : folder / "environments";
}

std::filesystem::path resolve_fabric(const std::string& reference, const std::string& coordinator) {
  const std::optional<FabricReference> parsed = parse_reference(reference);
  if (!parsed) {
    std::error_code failure;
    if (std::filesystem::is_regular_file(reference, failure)) {
      return reference;
    }
    if (std::filesystem::exists(reference, failure)) {
      throw core::Error(core::Code::kInvalidArgument,
                        reference + " is not a file; name a fabric database (.h5)");
    }
    throw core::Error(core::Code::kNotFound,
                      "there is no file " + reference +
                          "; name a database (.h5), or a published fabric like silk, silk@3 or "
                          "silk@latest ('weft fabrics' lists them)");
  }
  Client connection(coordinator);
  const v1::Version version = client::find_version(connection, reference);
  const std::filesystem::path folder = fabric_cache_folder();
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure) {
    throw core::Error(core::Code::kUnavailable,
                      "cannot make the folder " + folder.string() + ": " + failure.message() +
                          "; set XDG_CACHE_HOME to one that can be written");
  }
  std::filesystem::path path = folder / (client::version_digest(version).hex() + ".h5");
  client::fetch_version(connection, version, path, nullptr);
  trim_cache(folder, path);
  return path;
}

}  // namespace weft::cli
