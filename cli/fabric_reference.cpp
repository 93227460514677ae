#include "cli/fabric_reference.h"

#include <system_error>
#include <utility>
#include <vector>

#include "cli/client.h"
#include "client/fabric_cache.h"
#include "core/cache_folder.h"
#include "core/error.h"
#include "proto/names.h"

namespace weft::cli {

namespace {

constexpr std::size_t kDigitsLimit = 18;
constexpr std::uint64_t kCacheLimitBytes = std::uint64_t{16} << 30;

}  // namespace

std::optional<FabricReference> parse_reference(std::string_view text) {
  const std::size_t at = text.find_first_of("@:");
  const std::string_view name = text.substr(0, at);
  if (!v1::is_fabric_name(name)) {
    return std::nullopt;
  }
  FabricReference reference{std::string(name), std::nullopt};
  if (at == std::string_view::npos || text.substr(at) == "@latest") {
    return reference;
  }
  if (text[at] == ':') {
    reference.tag = text.substr(at + 1);
    return v1::is_tag(reference.tag) ? std::optional(std::move(reference)) : std::nullopt;
  }
  const std::string_view number = text.substr(at + 1);
  if (number.empty() || number.size() > kDigitsLimit || number.front() == '0' ||
      number.find_first_not_of("0123456789") != std::string_view::npos) {
    return std::nullopt;
  }
  reference.version = std::stoull(std::string(number));
  return reference;
}

std::string mistake_in_reference(const std::string& text) {
  return parse_reference(text)
             ? std::string()
             : "'" + text + "' is not a version; write NAME, NAME@NUMBER, NAME@latest or NAME:TAG";
}

std::filesystem::path fabric_cache_folder() {
  const std::filesystem::path folder = core::cache_folder();
  if (folder.empty()) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "there is no folder for fetched fabrics: neither XDG_CACHE_HOME nor HOME is "
                      "set; set one, or fetch the file with 'weft fetch' and name its path");
  }
  return folder / "fabrics";
}

std::filesystem::path environment_cache_folder() {
  const std::filesystem::path folder = core::cache_folder();
  return folder.empty() ? folder : folder / "environments";
}

std::filesystem::path resolve_fabric(const std::string& reference,
                                     const security::Endpoint& coordinator,
                                     const std::function<bool()>& should_stop) {
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
                          "; name a database (.h5), or a published fabric like silk, silk@3, "
                          "silk@latest or silk:approved ('weft fabrics' lists them)");
  }
  Client connection(coordinator);
  const v1::Version version = client::find_version(connection, reference);
  const client::FabricCache cache(fabric_cache_folder(), kCacheLimitBytes);
  return cache.fetch(connection, version, [&](std::uint64_t here, std::uint64_t total) {
    if (should_stop && here < total && should_stop()) {
      throw core::Error(core::Code::kCancelled, "cancelled while fetching " + reference);
    }
  });
}

}  // namespace weft::cli
